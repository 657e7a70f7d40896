"""Loss that grows with the load on the bearing."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart, turning
from gritd.estimator.stages.situation import Loaded
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class LoadDependentFriction(Effect):
    """The axle's bearing and seals consume a torque in proportion to the load that they carry.

    T + a W sign(ω),   a = μ d/2

    Source: frictional moment of a loaded bearing, M = ½ μ P d, SKF (2018), Rolling Bearings
    catalogue, section D.1; μ 0.001-0.002 for ball bearings, 0.05-0.2 for plain bearings.
    """

    arm: float = strength(
        "friction coefficient times bearing radius, a", "m", typical=1e-3, low=0.0, high=0.02
    )

    stage = "drivetrain"
    fingerprint = Fingerprint(
        "torque", "load", "current grows with load beyond the axle torque; nothing when lifted"
    )
    confusable_with = told_apart(
        coulomb_friction="load_step",
        torque_constant_error="slip_step",
        sidewall_friction="slip_step",
    )

    def torque_loss(self, situation: Loaded) -> Scalar:
        return self.arm * situation.carried * turning(situation.wheel_speed)
