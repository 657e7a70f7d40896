"""A hub that lifts the potentiometer."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Sensed, Situation
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class HubRunout(Effect):
    """A hub or an axle that runs out of true lifts the potentiometer once a turn; the forces do not
    change.

    z_read = z + a cos ψ + b sin ψ

    Source: rigid-body kinematics. `wheel_eccentricity` moves the rim in the soil as well.
    """

    lift_cos: float = strength("runout in phase, a", "m", typical=1e-3, low=-0.02, high=0.02)
    lift_sin: float = strength("runout in quadrature, b", "m", typical=1e-3, low=-0.02, high=0.02)

    stage = "sensor"
    fingerprint = Fingerprint("sinkage", "wheel_angle", "one cycle a turn in sinkage alone")
    confusable_with = told_apart(wheel_eccentricity="load_step", grousers="lifted_spin")

    def sensors(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(sensed, sinkage=sensed.sinkage + self._lift(situation.wheel_angle))

    def correct(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(sensed, sinkage=sensed.sinkage - self._lift(situation.wheel_angle))

    def _lift(self, angle: Scalar) -> Scalar:
        """What the potentiometer reads too much [m]."""
        return self.lift_cos * np.cos(angle) + self.lift_sin * np.sin(angle)
