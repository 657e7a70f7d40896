"""The amplified shunt in the motor's supply."""

from __future__ import annotations

from gritd.drivers.sensor import Analog


class MotorShunt(Analog):
    """Volts; the calibration's scale is amperes per volt."""

    channel = "motor_shunt"
