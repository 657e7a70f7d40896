"""Coulomb friction in the drivetrain."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart, turning
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class CoulombFriction(Effect):
    """Motor, gear and bearings consume a constant torque while the wheel turns.

    T_loss = T_C sign(ω)

    Source: Armstrong-Hélouvry, Dupont, Canudas de Wit (1994), Automatica 30, 1083-1138, section 2.
    """

    loss: float = strength("torque consumed, T_C", "N·m", typical=0.8, low=0.0, high=100.0)

    stage = "drivetrain"
    fingerprint = Fingerprint(
        "torque",
        "constant",
        "motor torque higher by the same amount at every load, slip and speed; nothing at rest",
    )
    confusable_with = told_apart(
        current_offset="standstill",
        asymmetric_friction="reversal",
        viscous_friction="speed_step",
        stribeck_friction="speed_step",
        torque_constant_error="load_step",
    )

    def torque_loss(self, situation: Situation) -> Scalar:
        return self.loss * turning(situation.wheel_speed)
