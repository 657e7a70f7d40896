"""Zero and known currents: scale and offset of the motor shunt."""

from gritd.tools.calibrate.sources import Signal
from gritd.tools.calibrate.straight import Straight

SUMMARY = "zero and known currents: scale and offset of the motor shunt"
SHUNT = Straight(Signal("motor_shunt", "volts", "V"), ("channels", "motor_shunt"), "A", "A/V", "A")
