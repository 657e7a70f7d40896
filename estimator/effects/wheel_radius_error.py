"""Radius of the wheel."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.terramechanics.soil import Wheel


@dataclass(frozen=True)
class WheelRadiusError(Effect):
    """The wheel rolls on another radius than the configured one.

    r (1 + e), in slip, in the contact and in the sinkage

    Source: calibration model.
    """

    error: float = strength(
        "relative error of the configured radius, e", "", typical=0.03, low=-0.3, high=0.3
    )

    stage = "sensor"
    fingerprint = Fingerprint(
        "drawbar_pull",
        "sinkage",
        "drawbar pull, torque and sinkage off, more where the wheel rides deep; slip off most "
        "where it is low",
    )
    confusable_with = told_apart(
        pulley_slip="tape", grousers="tape", torque_constant_error="slip_step"
    )

    def geometry(self, wheel: Wheel) -> Wheel:
        return replace(wheel, radius=wheel.radius * (1.0 + self.error))
