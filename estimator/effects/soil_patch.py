"""A place on the bed where the soil is another."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Soil

EDGE = 0.01  # [m] width over which one soil passes into the other


@dataclass(frozen=True)
class SoilPatch(Effect):
    """On one stretch of the bed the soil has another cohesion or friction angle.

    c · (1 + a w),   tan φ · (1 + b w)
    w(x) = ½ [tanh((x − x₀ + l/2)/δ) − tanh((x − x₀ − l/2)/δ)],   δ = 10 mm

    Source: a smooth window; Eq. (2) holds on either side with its own c and φ.
    """

    cohesion_change: float = strength(
        "relative change of c, a", "", typical=0.4, low=-1.0, high=10.0
    )
    friction_change: float = strength(
        "relative change of tan φ, b", "", typical=0.1, low=-0.8, high=1.5
    )
    centre: float = shape(
        "middle of the patch, x₀", "m", mean=0.5, sigma=0.5, low=-2.0, high=10.0, scan=True
    )
    length: float = shape(
        "length of the patch, l", "m", mean=0.3, sigma=0.2, low=0.02, high=5.0, scan=True
    )

    stage = "soil"
    fingerprint = Fingerprint(
        "drawbar_pull", "position", "drawbar pull, torque and sinkage step at one place on the bed"
    )
    confusable_with = told_apart(
        drying_cohesion="shifted_start", multipass="shifted_start", bed_slope="shifted_start"
    )

    def soil(self, soil: Soil, situation: Situation) -> Soil:
        along, half = situation.position - self.centre, 0.5 * self.length
        inside = 0.5 * (np.tanh((along + half) / EDGE) - np.tanh((along - half) / EDGE))
        return replace(
            soil,
            cohesion=soil.cohesion * (1.0 + self.cohesion_change * inside),
            tan_phi=soil.tan_phi * (1.0 + self.friction_change * inside),
        )
