"""Dense soil: shear stress peaks before it settles."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.situation import ContactLaw, Situation
from gritd.estimator.terramechanics.soil import Array


@dataclass(frozen=True)
class ShearPeak(Effect):
    """Dense or crusted soil resists shear up to a peak, then breaks and falls to a residual
    strength.

    τ = τ_res [(1 − e^(−j/k)) + P e (1 − e^(−j/K_w)) e^(−j/K_w)]

    With K_w = k this is Wong's third form, (1 − e^(−j/K_w)) [1 + P e^(1 − j/K_w)] with P = 1/(K_r
    (1 − 1/e)) − 1, written with the residual strength τ_res = K_r τ_max = c + σ tan φ in front: c
    and φ stay what they are in Eq. (2), and P = 0 is Eq. (2) itself. K_w is free because published
    peaks stand at other displacements: Oida's (1979) hump x e^(1 − x), x = j/k, has its top at k,
    not at 0.69 k, and is this one with K_w = 1.4 k within 7 %.
    Source: Wong (2008), Theory of Ground Vehicles, 4th ed., section 2.4.3; Wong and Preston-Thomas
    (1983).
    """

    overshoot: float = strength(
        "P: 0 is no peak, 1.4 a residual of two thirds", "", typical=0.4, low=0.0, high=5.0
    )
    breadth: float = shape(
        "K_w/k: the peak stands at j = 0.69 K_w", "", mean=1.0, sigma=0.5, low=0.2, high=5.0
    )

    stage = "contact"
    fingerprint = Fingerprint(
        "drawbar_pull",
        "sinkage",
        "more pull and torque where j is about k, less gain where j is far beyond; φ seems larger "
        "than it is",
    )
    confusable_with = told_apart(
        rear_contact="slip_step", stress_peak_shift="slip_step", rate_dependent_shear="slip_step"
    )

    def contact(self, law: ContactLaw, situation: Situation) -> ContactLaw:
        if not self.overshoot:
            return law
        settled = law.mobilisation

        def peaked(x: Array) -> Array:
            share = settled(x / self.breadth)
            hump: Array = share * (1.0 - np.abs(share))  # e^(−x) = 1 − share
            return settled(x) + self.overshoot * np.e * hump

        return replace(law, mobilisation=peaked)
