"""The motor weakens as it warms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.history import relaxed
from gritd.estimator.stages.situation import Powered, Recall
from gritd.estimator.terramechanics.soil import Scalar

LEAST = 0.02  # of K_t is always left


@dataclass(frozen=True)
class MotorHeating(Effect):
    """Current warms the winding and the magnets, and the torque per ampere falls.

    K_t / (1 + β H + β_w H_w),   τ dH/dt = I² − H,   τ_w dH_w/dt = I² − H_w
    H = H_w = 0 at the start of the run

    Source: thermal model of two bodies, Hendershot and Miller (2010), Design of Brushless
    Permanent-Magnet Machines: each answers R I² with two time constants, of the housing with the
    magnets and of the winding; K_t falls linearly in small rises of temperature; β and β_w join
    thermal resistance and magnet coefficient.
    """

    fall: float = strength(
        "relative fall per squared current, β", "1/A^2", typical=0.15, low=0.0, high=5.0
    )
    winding_fall: float = strength(
        "the same by the winding's heat, β_w", "1/A^2", typical=0.03, low=0.0, high=5.0
    )
    duration: float = shape(
        "thermal time constant, τ", "s", mean=300.0, sigma=200.0, low=2.0, high=3600.0, scan=True
    )
    winding: float = shape(
        "that of the winding, τ_w", "s", mean=40.0, sigma=25.0, low=2.0, high=120.0
    )

    stage = "drivetrain"
    every_run = True
    at_start = (0.0, 0.0)
    fingerprint = Fingerprint(
        "torque", "heat", "current creeps up over a run while measured axle torque stays"
    )
    confusable_with = told_apart(
        torque_constant_error="long_run", drying_cohesion="long_run", viscous_friction="long_run"
    )

    def torque_factor(self, situation: Powered) -> Scalar:
        housing, winding = self._heat(situation)
        left = 1.0 / (1.0 + self.fall * housing + self.winding_fall * winding)
        return np.maximum(left, LEAST)

    def remember(self, memory: Recall, step: float, situation: Powered) -> Recall:
        return tuple(
            float(heat + (situation.current**2 - heat) * -np.expm1(-step / duration))
            for heat, duration in zip(memory, self._durations, strict=True)
        )

    @property
    def _durations(self) -> tuple[float, float]:
        """τ, τ_w [s]."""
        return self.duration, self.winding

    def _heat(self, situation: Powered) -> tuple[Scalar, ...]:
        """H, H_w [A²]."""
        if self.name in situation.memory:
            return situation.memory[self.name]
        squared, time, run = situation.current**2, situation.time, situation.run
        return tuple(relaxed(time, squared, duration, run) for duration in self._durations)
