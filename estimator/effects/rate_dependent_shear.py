"""Shear strength that depends on speed."""

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
from gritd.estimator.stages.situation import ContactLaw, Situation


@dataclass(frozen=True)
class RateDependentShear(Effect):
    """Soil is stronger when it is sheared faster.

    (c, tan φ) · [1 + λ log₁₀((u + v_f)/(v₀ + v_f))],   u = (1 − m) r|ω| + m |rω − v|
    v₀ = 20 mm/s;   v_f = 1 mm/s keeps a standing wheel finite

    The speed is that of the rim (m = 0), or that at which it slides past the soil (m = 1).
    Source: Mitchell and Soga (2005), Fundamentals of Soil Behavior, 3rd ed., ch. 12: a few to ten
    per cent a decade of the rate of shearing.
    """

    per_decade: float = strength(
        "gain of strength per tenfold speed, λ", "", typical=0.08, low=-0.3, high=0.6
    )
    sliding: float = shape(
        "share in which the speed is that of sliding, m",
        "",
        mean=0.0,
        sigma=0.5,
        low=0.0,
        high=1.0,
    )

    stage = "contact"
    fingerprint = Fingerprint(
        "drawbar_pull",
        "speed",
        "drawbar pull and torque rise with the logarithm of speed at fixed slip",
    )
    confusable_with = told_apart(
        viscous_friction="speed_step",
        stribeck_friction="speed_step",
        rate_dependent_sinkage="speed_step",
    )

    def contact(self, law: ContactLaw, situation: Situation) -> ContactLaw:
        rim = situation.radius * situation.wheel_speed
        past = np.abs(rim - situation.carriage_speed)
        speed = np.abs(rim) + self.sliding * (past - np.abs(rim))
        decades = np.log10((speed + RATE_FLOOR) / (RATE_REFERENCE + RATE_FLOOR))
        return replace(law, strength=law.strength * (1.0 + self.per_decade * decades))
