"""A rim smoother than the soil."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.situation import ContactLaw, Situation
from gritd.estimator.terramechanics.soil import Array

LEAST = 0.05  # 1 − s, where the rim begins to slide


@dataclass(frozen=True)
class RimFriction(Effect):
    """The soil slides on a smooth rim before it shears in itself.

    τ = (c (1 − a) + σ tan φ (1 − s)) [(1 − q) m + q min(m/(1 − s), 1)],   m = 1 − e^(−j/k)
    tan δ = (1 − s) tan φ,   c_a = (1 − a) c

    q = 0: all shear is less by a share. q = 1: soil shears as ever until the rim slides on it.
    Source: Potyondy (1961), Géotechnique 11(4), 339-353: δ/φ 0.54 on smooth and 0.76 on rough
    steel in dry sand, hardly any adhesion; Wong (2008), Theory of Ground Vehicles, 4th ed.,
    section 2.4; Uesugi and Kishida (1986), Soils and Foundations 26(1), 33-46: before it slides,
    sand on steel moves by its own shear alone.
    """

    smoothness: float = strength(
        "share of the soil's friction that is missing, s", "", typical=0.25, low=0.0, high=1.0
    )
    adhesion_loss: float = strength(
        "share of the soil's cohesion that does not adhere, a", "", typical=0.5, low=0.0, high=1.0
    )
    sliding: float = shape(
        "share in which soil shears as ever until the rim slides, q",
        "",
        mean=0.0,
        sigma=0.5,
        low=0.0,
        high=1.0,
    )

    stage = "contact"
    fingerprint = Fingerprint(
        "drawbar_pull",
        "load",
        "torque and drawbar pull lower by a share, as on a soil of smaller φ and c",
    )
    confusable_with = told_apart(grousers="rough_rim", shear_peak="rough_rim")

    def contact(self, law: ContactLaw, situation: Situation) -> ContactLaw:
        shear, least = law.mobilisation, np.maximum(1.0 - self.smoothness, LEAST)

        def sliding(x: Array) -> Array:
            share = shear(x)
            slid: Array = np.clip(share / least, -1.0, 1.0)
            return share + self.sliding * (slid - share)

        return replace(
            law,
            adhesion=law.adhesion * (1.0 - self.adhesion_loss),
            friction=law.friction * (1.0 - self.smoothness),
            mobilisation=sliding if self.smoothness and self.sliding else shear,
        )
