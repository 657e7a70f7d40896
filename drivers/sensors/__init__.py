"""The sensor kinds, one file each; drivers.sensor.sensor_kinds() finds them here."""
