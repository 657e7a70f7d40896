"""The sensor kinds, one file each; gritd.drivers.sensor.sensor_kinds() finds them here."""
