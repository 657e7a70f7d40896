"""From measurements with known values to scale and offset, each with its uncertainty."""
