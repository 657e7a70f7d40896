"""Cohesion that drifts while the soil dries."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Soil


@dataclass(frozen=True)
class DryingCohesion(Effect):
    """Cohesion drifts in time as moist soil dries.

    c · [1 + a (1 − e^(−t/τ))]

    Source: first-order loss of apparent cohesion, c = suction · tan φ_b (Fredlund, Morgenstern,
    Widger 1978, Canadian Geotechnical J. 15, 313-321), suction relaxing exponentially.
    """

    change: float = strength("final relative change of c, a", "", typical=0.4, low=-1.0, high=10.0)
    duration: float = shape(
        "time constant, τ", "s", mean=300.0, sigma=300.0, low=10.0, high=36e3, scan=True
    )

    stage = "soil"
    fingerprint = Fingerprint(
        "drawbar_pull", "time", "drawbar pull and torque drift with time, the same at every speed"
    )
    confusable_with = told_apart(
        motor_heating="long_run", multipass="shifted_start", soil_patch="shifted_start"
    )

    def soil(self, soil: Soil, situation: Situation) -> Soil:
        return replace(
            soil,
            cohesion=soil.cohesion
            * (1.0 - self.change * np.expm1(-situation.time / self.duration)),
        )
