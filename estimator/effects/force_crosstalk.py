"""Leakage between the axes of the force sensor."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Sensed, Situation
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class ForceCrosstalk(Effect):
    """Torque or load leaks into the drawbar-pull channel of the force sensor.

    DP_read = DP + a T + b W, with T and W as the sensor reads them

    Source: off-diagonal terms of a six-axis sensor's calibration matrix.
    """

    from_torque: float = strength("pull read per torque, a", "1/m", typical=0.5, low=-5.0, high=5.0)
    from_load: float = strength("pull read per load, b", "", typical=0.02, low=-0.3, high=0.3)

    stage = "sensor"
    fingerprint = Fingerprint(
        "drawbar_pull", "load", "drawbar pull off in proportion to torque or load"
    )
    confusable_with = told_apart(
        bed_slope="level", side_wall_rubbing="reversal", bulldozing="reversal"
    )

    def sensors(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(sensed, drawbar_pull=sensed.drawbar_pull + self._leak(sensed))

    def correct(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(sensed, drawbar_pull=sensed.drawbar_pull - self._leak(sensed))

    def _leak(self, sensed: Sensed) -> Scalar:
        return self.from_torque * sensed.torque + self.from_load * sensed.load
