"""A fitted expression where no listed physics explains the recordings."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import (
    RATE_FLOOR,
    RATE_REFERENCE,
    Effect,
    Fingerprint,
    shape,
    strength,
    told_apart,
)
from gritd.estimator.stages.situation import Balanced, Reaction
from gritd.estimator.terramechanics.soil import Scalar


def _torque(term: str) -> float:
    return strength(  # type: ignore[no-any-return]
        f"torque per {term}", "N·m", typical=0.2, low=-20.0, high=20.0
    )


def _pull(term: str) -> float:
    return strength(  # type: ignore[no-any-return]
        f"drawbar pull per {term}", "N", typical=1.0, low=-200.0, high=200.0
    )


def _depth(term: str) -> float:
    return strength(  # type: ignore[no-any-return]
        f"sinkage per {term}", "m", typical=2e-4, low=-0.05, high=0.05
    )


@dataclass(frozen=True)
class EmpiricalLaw(Effect):
    """Something acts that no listed effect explains; a fitted expression stands for it within its
    domain.

    y + a₀ + a₁ i + a₂ i² + a₃ ζ + a₄ ν for y = T, DP (along the travel) and z

    ζ = z/r,   ν = ln((r|ω| + v_f)/(v₀ + v_f)),   v₀ = 20 mm/s,   v_f = 1 mm/s

    Outside the domain i, ζ and ν keep the value at its edge. Source: none; that is what the name
    says.
    """

    torque_constant: float = _torque("1")
    torque_slip: float = _torque("i")
    torque_slip_squared: float = _torque("i²")
    torque_sinkage: float = _torque("ζ")
    torque_speed: float = _torque("ν")
    pull_constant: float = _pull("1")
    pull_slip: float = _pull("i")
    pull_slip_squared: float = _pull("i²")
    pull_sinkage: float = _pull("ζ")
    pull_speed: float = _pull("ν")
    depth_constant: float = _depth("1")
    depth_slip: float = _depth("i")
    depth_slip_squared: float = _depth("i²")
    depth_sinkage: float = _depth("ζ")
    depth_speed: float = _depth("ν")
    slip_from: float = shape("domain of i", "", mean=0.0, sigma=0.1, low=-1.0, high=1.0)
    slip_to: float = shape("domain of i", "", mean=0.8, sigma=0.1, low=-1.0, high=1.0)
    sinkage_from: float = shape("domain of ζ", "", mean=0.0, sigma=0.1, low=0.0, high=1.0)
    sinkage_to: float = shape("domain of ζ", "", mean=0.9, sigma=0.1, low=0.0, high=1.0)
    speed_from: float = shape(
        "domain of the rim speed", "m/s", mean=0.0, sigma=0.01, low=0.0, high=10.0
    )
    speed_to: float = shape(
        "domain of the rim speed", "m/s", mean=0.1, sigma=0.05, low=0.0, high=10.0
    )

    stage = "any"
    fingerprint = Fingerprint(
        "torque", "speed", "whatever the fit found, in the channel and over the covariate it found"
    )
    confusable_with = told_apart(
        coulomb_friction="speed_step", bulldozing="slip_step", sinkage_datum="tape"
    )

    def testbed(self, reaction: Reaction, situation: Balanced) -> Reaction:
        terms = self._terms(situation)
        torque = (
            self.torque_constant,
            self.torque_slip,
            self.torque_slip_squared,
            self.torque_sinkage,
            self.torque_speed,
        )

        pull = (
            self.pull_constant,
            self.pull_slip,
            self.pull_slip_squared,
            self.pull_sinkage,
            self.pull_speed,
        )

        depth = (
            self.depth_constant,
            self.depth_slip,
            self.depth_slip_squared,
            self.depth_sinkage,
            self.depth_speed,
        )

        return replace(
            reaction,
            torque=reaction.torque + situation.direction * _sum(torque, terms),
            drawbar_pull=reaction.drawbar_pull + situation.direction * _sum(pull, terms),
            sinkage=reaction.sinkage + _sum(depth, terms),
        )

    def _terms(self, situation: Balanced) -> tuple[Scalar, ...]:
        """1, i, i², ζ, ν."""
        slip = np.clip(situation.slip, self.slip_from, self.slip_to)
        depth = np.clip(situation.sinkage / situation.radius, self.sinkage_from, self.sinkage_to)
        speed = np.clip(
            situation.radius * np.abs(situation.wheel_speed), self.speed_from, self.speed_to
        )

        return (
            1.0,
            slip,
            slip * slip,
            depth,
            np.log((speed + RATE_FLOOR) / (RATE_REFERENCE + RATE_FLOOR)),
        )


def _sum(coefficients: tuple[float, ...], terms: tuple[Scalar, ...]) -> Scalar:
    total: Scalar = 0.0
    for coefficient, term in zip(coefficients, terms, strict=True):
        total = total + coefficient * term
    return total
