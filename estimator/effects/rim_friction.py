"""A rim smoother than the soil."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import ContactLaw, Situation


@dataclass(frozen=True)
class RimFriction(Effect):
    """The soil slides on a smooth rim before it shears in itself.

    τ = (c (1 − a) + σ tan φ (1 − s))(1 − e^(−j/k)),   tan δ = (1 − s) tan φ,   c_a = (1 − a) c

    Source: Potyondy (1961), Géotechnique 11(4), 339-353: δ/φ 0.54 on smooth and 0.76 on rough
    steel in dry sand, hardly any adhesion; Wong (2008), Theory of Ground Vehicles, 4th ed.,
    section 2.4.
    """

    smoothness: float = strength(
        "share of the soil's friction that is missing, s", "", typical=0.25, low=0.0, high=1.0
    )
    adhesion_loss: float = strength(
        "share of the soil's cohesion that does not adhere, a", "", typical=0.5, low=0.0, high=1.0
    )

    stage = "contact"
    fingerprint = Fingerprint(
        "drawbar_pull",
        "load",
        "torque and drawbar pull lower by a share, as on a soil of smaller φ and c",
    )
    confusable_with = told_apart(grousers="rough_rim", shear_peak="rough_rim")

    def contact(self, law: ContactLaw, situation: Situation) -> ContactLaw:
        return replace(
            law,
            adhesion=law.adhesion * (1.0 - self.adhesion_loss),
            friction=law.friction * (1.0 - self.smoothness),
        )
