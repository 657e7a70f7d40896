"""Sinkage that depends on speed."""

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
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Soil


@dataclass(frozen=True)
class RateDependentSinkage(Effect):
    """Soil that is loaded faster yields less, so a faster wheel rides higher.

    K · ((u + v_f)/(v₀ + v_f))^m,   u = (1 − s) r|ω| + s |v|
    v₀ = 20 mm/s;   v_f = 1 mm/s keeps a standing wheel finite

    The speed is that of the rim, which goes down at r|ω| sin θ (s = 0), or that of travel, for a
    wheel that passes presses the soil down at |v| tan θ (s = 1).
    Source: Grahn (1991), J. Terramechanics 28: p = k ż^m zⁿ with the rate of penetration ż.
    """

    power: float = strength("exponent of speed, m", "", typical=0.08, low=-0.5, high=1.0)
    travel: float = shape(
        "share in which the speed is that of travel, s",
        "",
        mean=0.0,
        sigma=0.5,
        low=0.0,
        high=1.0,
    )

    stage = "soil"
    fingerprint = Fingerprint("sinkage", "speed", "sinkage falls with speed at fixed load and slip")
    confusable_with = told_apart(rate_dependent_shear="speed_step", multipass="speed_step")

    def soil(self, soil: Soil, situation: Situation) -> Soil:
        rim, passing = situation.radius * situation.wheel_speed, np.abs(situation.carriage_speed)
        speed = np.abs(rim) + self.travel * (passing - np.abs(rim))
        return replace(
            soil,
            modulus=soil.modulus
            * ((speed + RATE_FLOOR) / (RATE_REFERENCE + RATE_FLOOR)) ** self.power,
        )
