"""Known weights on the force/torque sensor: scale and offset of its vertical axis."""

from gritd.tools.calibrate.sources import Signal
from gritd.tools.calibrate.straight import Straight

SUMMARY = "known weights: scale and offset of the force/torque sensor's vertical axis"
LOAD = Straight(Signal("wrench", "fz", "N"), ("channels", "wrench", "load"), "N", "", "N")
