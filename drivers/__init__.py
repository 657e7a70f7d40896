"""From the bytes on a wire to readings in a queue."""
