"""Torque per ampere."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class TorqueConstantError(Effect):
    """The torque per ampere is off by a factor.

    K_t (1 + e)

    Source: calibration model; a gear's efficiency enters the same way while it drives.
    """

    error: float = strength(
        "relative error of the configured constant, e", "", typical=0.08, low=-0.8, high=2.0
    )

    stage = "sensor"
    fingerprint = Fingerprint("torque", "load", "motor torque off in proportion to itself")
    confusable_with = told_apart(
        coulomb_friction="load_step",
        motor_heating="long_run",
        sidewall_friction="slip_step",
        shear_peak="load_step",
    )

    def torque_factor(self, situation: Situation) -> Scalar:
        return 1.0 + self.error
