"""Break-away friction that falls with speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart, turning
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class StribeckFriction(Effect):
    """At creeping speed the drivetrain sticks: the loss is highest at break-away and falls as a
    film forms.

    T_loss = T_S e^(−(ω/ω_S)²) sign(ω), above the Coulomb level

    Source: Armstrong-Hélouvry, Dupont, Canudas de Wit (1994), Automatica 30, 1083-1138,
    Gaussian form of the Stribeck curve.
    """

    excess: float = strength(
        "break-away above the Coulomb loss, T_S", "N·m", typical=0.6, low=0.0, high=10.0
    )
    speed: float = shape(
        "speed at which it has fallen to 1/e, ω_S",
        "rad/s",
        mean=0.15,
        sigma=0.1,
        low=0.03,
        high=2.0,
    )

    stage = "drivetrain"
    fingerprint = Fingerprint("torque", "speed", "motor torque falls as a slow wheel speeds up")
    confusable_with = told_apart(
        coulomb_friction="speed_step",
        viscous_friction="speed_step",
        rate_dependent_shear="speed_step",
    )

    def torque_loss(self, situation: Situation) -> Scalar:
        creeping = np.exp(-((situation.wheel_speed / self.speed) ** 2))
        return self.excess * creeping * turning(situation.wheel_speed)
