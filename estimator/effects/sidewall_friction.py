"""Soil shearing along the buried faces of the wheel."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Balanced, Reaction
from gritd.estimator.terramechanics.soil import Array

AT_REST = 0.5  # lateral over normal stress in soil confined by the wheel [-]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)
STILL = 0.02  # [-] of r: distance from the centre of rotation below which a point does not slide


@dataclass(frozen=True)
class SidewallFriction(Effect):
    """Both faces of the wheel rub on the soil in which they are buried.

    T + 2∫τ_f [x² − y(V − y)]/|u| dA,   DP − 2∫τ_f (V − y)/|u| dA
    τ_f = s (c + K₀ σ̄ tan φ),   K₀ = ½,   σ̄ = W/(b r sin θ₁)
    u ∝ (V − y, x),   V = r(1 − i)

    On the buried segment of each face, against the sliding velocity u of a point x ahead of and y
    below the axle. The lift of the faces is left out. Source: rigid-plastic sliding of a disc;
    Mohr-Coulomb strength as in Eq. (2), and the faces of the wheel as in Ishigami et al. (2007), J.
    Field Robotics 24, 233-250.
    """

    share: float = strength(
        "strength mobilised on the faces, s", "", typical=0.3, low=0.0, high=3.0
    )

    stage = "wheel"
    fingerprint = Fingerprint(
        "drawbar_pull",
        "slip",
        "torque grows with sinkage faster than the rim explains; pull gains at high slip, loses at "
        "low",
    )
    confusable_with = told_apart(
        bulldozing="slip_step", coulomb_friction="slip_step", torque_constant_error="slip_step"
    )

    def wheel(self, reaction: Reaction, situation: Balanced) -> Reaction:
        r, sine = situation.radius, np.sin(situation.theta_1)
        pressure = AT_REST * situation.carried / (situation.width * r * np.maximum(sine, 1e-6))
        stress = self.share * (situation.cohesion + pressure * situation.tan_phi)
        torque, pull = _face(np.asarray(situation.theta_1), np.asarray(situation.slip))
        return replace(
            reaction,
            torque=reaction.torque + situation.direction * 2.0 * stress * r**3 * torque,
            drawbar_pull=reaction.drawbar_pull + situation.direction * 2.0 * stress * r**2 * pull,
        )


def _face(theta_1: Array, slip: Array) -> tuple[Array, Array]:
    """Moment over r³ and forward force over r² of unit stress on the buried front half of one face,
    5 × 5 nodes.
    """
    moment, force = np.zeros(np.shape(theta_1)), np.zeros(np.shape(theta_1))

    # V/r
    rolling = 1.0 - np.maximum(slip, 0.0) - np.minimum(slip, 0.0) / np.maximum(1.0 + slip, 0.05)
    top = np.cos(theta_1)
    for node, weight in zip(0.5 * (NODES + 1.0), 0.5 * WEIGHTS, strict=True):
        x = node * np.sin(theta_1)
        depth = np.sqrt(1.0 - x * x) - top
        for inner, share in zip(0.5 * (NODES + 1.0), 0.5 * WEIGHTS, strict=True):
            y = top + inner * depth
            sliding = np.sqrt((rolling - y) ** 2 + x * x + STILL**2)
            area = weight * share * np.sin(theta_1) * depth
            moment = moment + area * (x * x - y * (rolling - y)) / sliding
            force = force - area * (rolling - y) / sliding

    return moment, force
