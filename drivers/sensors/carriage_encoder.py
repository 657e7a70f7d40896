"""The incremental encoder on the pulley that the carriage's belt turns."""

from __future__ import annotations

from gritd.drivers.sensor import Encoder


class CarriageEncoder(Encoder):
    """Counts; the calibration's scale is radians of the pulley per count."""

    channel = "carriage_encoder"
