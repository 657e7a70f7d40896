"""Inertia of wheel, gear and rotor."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class WheelInertia(Effect):
    """Torque is needed to speed the wheel up and comes back when it slows down.

    T_loss = J dω/dt

    Source: Newton's second law; J holds the rotor's inertia times the square of the gear ratio,
    which is nearly all of it: a torque sensor behind the gear does not see it.
    """

    inertia: float = strength(
        "moment of inertia at the axle, J", "kg·m^2", typical=0.3, low=0.0, high=5.0
    )

    stage = "drivetrain"
    fingerprint = Fingerprint(
        "torque",
        "acceleration",
        "motor torque pulses while the speed changes, none at steady speed",
    )
    confusable_with = told_apart(sensor_latency="speed_step", stribeck_friction="speed_step")

    def torque_loss(self, situation: Situation) -> Scalar:
        return self.inertia * situation.wheel_acceleration
