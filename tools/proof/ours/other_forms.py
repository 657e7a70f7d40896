"""Listed physics in other published forms, for trials: the name must survive a formula that is not
ours.

The class's `stands_for` is the name the diagnosis should give.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from gritd.estimator.effects.base import Effect, Fingerprint, strength, turning
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Scalar


def _size(typical: float, low: float = 0.0) -> float:
    return strength("size", "", typical=typical, low=low, high=1e6)  # type: ignore[no-any-return]


class Cousin(Effect):
    """Another form of a listed effect."""

    stands_for: ClassVar[str]
    fingerprint = Fingerprint("torque", "constant", "")


@dataclass(frozen=True)
class HessSoomFriction(Cousin):
    """Break-away friction as T_S/(1 + (ω/ω_S)²) (Hess and Soom 1990)."""

    size: float = _size(0.6)
    stage = "drivetrain"
    stands_for = "stribeck_friction"

    def torque_loss(self, situation: Situation) -> Scalar:
        return (
            self.size / (1.0 + (situation.wheel_speed / 0.12) ** 2) * turning(situation.wheel_speed)
        )
