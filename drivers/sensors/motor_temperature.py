"""The temperature of the motor's winding or case."""

from __future__ import annotations

from gritd.drivers.sensor import Analog


class MotorTemperature(Analog):
    """Degrees Celsius."""

    channel = "motor_temperature"
