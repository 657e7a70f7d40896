"""Friction that differs by direction."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart, turning
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class AsymmetricFriction(Effect):
    """The drivetrain loses more torque in one direction of rotation than in the other.

    T_loss = A sign²(ω): A more than the mean loss forward, A less backward, nothing at rest

    Source: direction-dependent Coulomb level, Armstrong-Hélouvry, Dupont, Canudas de Wit (1994),
    Automatica 30, 1083-1138; the offset term of the EMPS benchmark, Janot, Gautier, Brunot (2019).
    """

    difference: float = strength(
        "half the difference between directions, A", "N·m", typical=0.4, low=-5.0, high=5.0
    )

    stage = "drivetrain"
    fingerprint = Fingerprint(
        "torque", "constant", "motor torque shifted the same way whichever way the wheel turns"
    )
    confusable_with = told_apart(coulomb_friction="reversal", current_offset="standstill")

    def torque_loss(self, situation: Situation) -> Scalar:
        return self.difference * turning(situation.wheel_speed) ** 2
