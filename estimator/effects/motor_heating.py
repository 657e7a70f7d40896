"""The motor weakens as it warms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.history import relaxed
from gritd.estimator.stages.situation import Powered, Recall
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class MotorHeating(Effect):
    """Current warms the winding and the magnets, and the torque per ampere falls.

    K_t / (1 + β H),   τ dH/dt = I² − H,   H = 0 at the start of the run

    Source: one-body winding thermal model τ dΔT/dt = R_th R I² − ΔT with K_t falling linearly in a
    small ΔT, Hendershot and Miller (2010), Design of Brushless Permanent-Magnet Machines; β joins
    thermal resistance and magnet coefficient.
    """

    fall: float = strength(
        "relative fall per squared current, β", "1/A^2", typical=0.15, low=0.0, high=5.0
    )
    duration: float = shape(
        "thermal time constant, τ", "s", mean=300.0, sigma=200.0, low=2.0, high=3600.0, scan=True
    )

    stage = "drivetrain"
    every_run = True
    fingerprint = Fingerprint(
        "torque", "heat", "current creeps up over a run while measured axle torque stays"
    )
    confusable_with = told_apart(
        torque_constant_error="long_run", drying_cohesion="long_run", viscous_friction="long_run"
    )

    def torque_factor(self, situation: Powered) -> Scalar:
        return 1.0 / (1.0 + self.fall * self._heat(situation))

    def remember(self, memory: Recall, step: float, situation: Powered) -> Recall:
        (heat,) = memory
        return (float(heat + (situation.current**2 - heat) * -np.expm1(-step / self.duration)),)

    def _heat(self, situation: Powered) -> Scalar:
        """H [A²]."""
        if self.name in situation.memory:
            return situation.memory[self.name][0]
        return relaxed(situation.time, situation.current**2, self.duration, situation.run)
