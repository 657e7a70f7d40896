"""Sinkage that depends on speed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import (
    RATE_FLOOR,
    RATE_REFERENCE,
    Effect,
    Fingerprint,
    strength,
    told_apart,
)
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Soil


@dataclass(frozen=True)
class RateDependentSinkage(Effect):
    """Soil that is loaded faster yields less, so a faster wheel rides higher.

    K · ((r|ω| + v_f)/(v₀ + v_f))^m,   v₀ = 20 mm/s,   v_f = 1 mm/s keeps a standing wheel finite

    Source: Grahn (1991), J. Terramechanics 28: p = k ż^m zⁿ; the penetration rate ż scales with
    speed.
    """

    power: float = strength("exponent of speed, m", "", typical=0.08, low=-0.5, high=1.0)

    stage = "soil"
    fingerprint = Fingerprint("sinkage", "speed", "sinkage falls with speed at fixed load and slip")
    confusable_with = told_apart(rate_dependent_shear="speed_step", multipass="speed_step")

    def soil(self, soil: Soil, situation: Situation) -> Soil:
        speed = situation.radius * np.abs(situation.wheel_speed)
        return replace(
            soil,
            modulus=soil.modulus
            * ((speed + RATE_FLOOR) / (RATE_REFERENCE + RATE_FLOOR)) ** self.power,
        )
