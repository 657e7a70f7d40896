"""The linear potentiometer between carriage and wheel axle."""

from __future__ import annotations

from gritd.drivers.sensor import Analog


class SinkagePot(Analog):
    """Volts; the calibration's scale is metres of sinkage per volt."""

    channel = "sinkage_pot"
