"""Bed and rail are not parallel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Reaction, Sensed, Situation
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class BedInclination(Effect):
    """The soil surface rises along the rail, so the wheel climbs and the potentiometer reads its
    height as sinkage.

    W cos α on the soil;   DP − W sin α;   z_read = z − x tan α,   α positive where the bed rises

    x is the place on the bed. Source: statics and geometry. `bed_slope` is a bed and a rail tilted
    together: then the potentiometer sees nothing of it.
    """

    angle: float = strength(
        "slope of the bed against the rail, α", "rad", typical=5e-3, low=-0.35, high=0.35
    )

    stage = "testbed"
    fingerprint = Fingerprint(
        "sinkage", "position", "sinkage drifts along the bed; drawbar pull off by a share of load"
    )
    confusable_with = told_apart(
        bed_slope="shifted_start", soil_patch="shifted_start", sensor_drift="shifted_start"
    )

    def load(self, load: Scalar, situation: Situation) -> Scalar:
        return load * float(np.cos(self.angle))

    def testbed(self, reaction: Reaction, situation: Situation) -> Reaction:
        return replace(
            reaction, drawbar_pull=reaction.drawbar_pull - situation.load * np.sin(self.angle)
        )

    def sensors(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(sensed, sinkage=sensed.sinkage - np.tan(self.angle) * situation.position)

    def correct(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(sensed, sinkage=sensed.sinkage + np.tan(self.angle) * situation.position)
