"""Torque ripple of the gear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart, turning
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class GearRipple(Effect):
    """Meshing teeth make the motor torque ripple at a fixed order of the wheel angle.

    T_loss = (a cos Nψ + b sin Nψ) s²,   s = tanh(ω/ω₀)

    A wheel at rest has none: static friction holds it, with no current.

    Source: first harmonic of the transmission error, Armstrong-Hélouvry, Dupont, Canudas de Wit
    (1994), Automatica 30, 1083-1138, position-dependent friction.
    """

    ripple_cos: float = strength("ripple in phase, a", "N·m", typical=0.2, low=-3.0, high=3.0)
    ripple_sin: float = strength("ripple in quadrature, b", "N·m", typical=0.2, low=-3.0, high=3.0)
    order: float = shape(
        "ripples a turn of the wheel, N", "", mean=40.0, sigma=30.0, low=2.0, high=200.0, scan=True
    )

    stage = "drivetrain"
    fingerprint = Fingerprint(
        "torque",
        "wheel_angle",
        "N ripples a turn in motor current only, also with the wheel lifted",
    )
    confusable_with = told_apart(grousers="lifted_spin", wheel_eccentricity="lifted_spin")

    def torque_loss(self, situation: Situation) -> Scalar:
        phase = self.order * situation.wheel_angle
        ripple = self.ripple_cos * np.cos(phase) + self.ripple_sin * np.sin(phase)
        return ripple * turning(situation.wheel_speed) ** 2
