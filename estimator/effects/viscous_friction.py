"""Viscous friction in the drivetrain."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class ViscousFriction(Effect):
    """Motor, gear and grease consume a torque proportional to speed.

    T_loss = B ω

    Source: Armstrong-Hélouvry, Dupont, Canudas de Wit (1994), Automatica 30, 1083-1138, section 2.
    """

    damping: float = strength("loss per speed, B", "N·m·s/rad", typical=1.0, low=0.0, high=30.0)

    stage = "drivetrain"
    fingerprint = Fingerprint(
        "torque", "speed", "motor torque rises in proportion to speed, also with the wheel lifted"
    )
    confusable_with = told_apart(
        coulomb_friction="speed_step",
        rate_dependent_shear="speed_step",
        stribeck_friction="speed_step",
    )

    def torque_loss(self, situation: Situation) -> Scalar:
        return self.damping * situation.wheel_speed
