"""Gauge blocks under the wheel, or any known heights: scale and offset of the potentiometer."""

from gritd.tools.calibrate.sources import Signal
from gritd.tools.calibrate.straight import Straight

SUMMARY = "known heights (gauge blocks): scale and offset of the potentiometer"
POT = Straight(Signal("sinkage_pot", "volts", "V"), ("channels", "sinkage_pot"), "m", "m/V", "mm")
