"""The incremental encoder on the wheel's axle."""

from __future__ import annotations

from gritd.drivers.sensor import Encoder


class WheelEncoder(Encoder):
    """Counts; the calibration's scale is radians per count."""

    channel = "wheel_encoder"
