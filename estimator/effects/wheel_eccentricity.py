"""The axle is not in the middle of the wheel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Balanced, Motion, Reaction
from gritd.estimator.terramechanics.soil import Scalar, Wheel


@dataclass(frozen=True)
class WheelEccentricity(Effect):
    """The radius below the axle varies once a turn.

    R(ψ) = r + a cos ψ + b sin ψ;   rim speed R ω;   sinkage of the axle z − (R − r);   T + W dR/dψ

    The last term is the work of lifting the load W. Source: rigid-body kinematics of an eccentric
    disc.
    """

    offset_cos: float = strength(
        "eccentricity in phase, a", "m", typical=1e-3, low=-0.02, high=0.02
    )
    offset_sin: float = strength(
        "eccentricity in quadrature, b", "m", typical=1e-3, low=-0.02, high=0.02
    )

    stage = "wheel"
    fingerprint = Fingerprint("sinkage", "wheel_angle", "one cycle a turn in sinkage and torque")
    confusable_with = told_apart(gear_ripple="lifted_spin", grousers="tape")

    def motion(self, motion: Motion, wheel: Wheel) -> Motion:
        return replace(
            motion,
            wheel_speed=motion.wheel_speed * (1.0 + self._lift(motion.wheel_angle) / wheel.radius),
        )

    def wheel(self, reaction: Reaction, situation: Balanced) -> Reaction:
        angle = situation.wheel_angle
        slope = self.offset_sin * np.cos(angle) - self.offset_cos * np.sin(angle)  # dR/dψ
        return replace(
            reaction,
            sinkage=reaction.sinkage - self._lift(angle),
            torque=reaction.torque + situation.carried * slope,
        )

    def _lift(self, angle: Scalar) -> Scalar:
        """R − r [m]."""
        return self.offset_cos * np.cos(angle) + self.offset_sin * np.sin(angle)
