"""A wheel that does not point where it goes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import (
    Effect,
    Fingerprint,
    Parameter,
    shape,
    strength,
    told_apart,
)
from gritd.estimator.stages.situation import Balanced, ContactLaw, Reaction, Situation
from gritd.estimator.terramechanics.original import velocity_ratio


@dataclass(frozen=True)
class SideSlip(Effect):
    """The wheel is toed in or out, so it slides sideways too: less shear strength is left along its
    plane, and it digs.

    (τ_x, τ_y) = τ(j) [(1 − m)(j_x, j_y)/j + m (s_x, s_y)/s],   j² = j_x² + j_y²
    j_y = κ r (v/rω)(θ₁ − θ) tan β, j_x by Eq. (6);   s_x = 1 − (v/rω) cos θ,   s_y = (v/rω) tan β
    side force = r b ∫ τ_y dθ;   z + d min(1, v/rω) tan β

    The shear stress has the direction of the displacement j (m = 0), or of the sliding s (m = 1).
    The soil may yield sideways by another shear modulus than along the wheel, κ = k_x/k_y, as in
    the source. Soil that a wheel carries aside digs, as that does which it carries back
    (`slip_sinkage`). Where no side force is compared, κ is 1.5 and d is 0: what shows there is
    κ tan β, so β is no surer than κ, which its σ does not hold.
    Source: Ishigami, Miwa, Nagatani, Yoshida (2007), J. Field Robotics 24, 233-250, Eq. (9); Wong
    (2008), Theory of Ground Vehicles, 4th ed., ch. 1, for the sliding.
    """

    angle: float = strength(
        "angle between wheel and travel, β", "rad", typical=0.35, low=0.0, high=1.4
    )

    sliding: float = shape(
        "share in which stress follows the sliding, m", "", mean=0.0, sigma=0.5, low=0.0, high=1.0
    )

    digging: float = shape(
        "depth that a wheel digs that slides sideways as fast as its rim, d",
        "m",
        mean=0.0,
        sigma=5e-3,
        low=0.0,
        high=0.02,
    )

    across: float = shape(
        "shear modulus along the wheel over that across it, κ",
        "",
        mean=1.5,
        sigma=0.55,
        low=0.0,
        high=6.0,
    )

    stage = "contact"
    fingerprint = Fingerprint(
        "drawbar_pull",
        "sinkage",
        "torque and drawbar pull lower, the more the deeper and the lower the slip",
    )
    confusable_with = told_apart(
        rim_friction="slip_step", pulley_slip="slip_step", shear_peak="slip_step"
    )

    def contact(self, law: ContactLaw, situation: Situation) -> ContactLaw:
        tangent = law.side_slip + float(np.tan(self.angle))
        return replace(law, side_slip=tangent, by_sliding=self.sliding, across=self.across)

    def wheel(self, reaction: Reaction, situation: Balanced) -> Reaction:
        slid = np.minimum(velocity_ratio(situation.slip), 1.0) * float(np.tan(self.angle))
        return replace(reaction, sinkage=reaction.sinkage + self.digging * slid)

    @classmethod
    def without_side_force(cls) -> type[Effect]:
        return SideSlipInPlane


class SideSlipInPlane(SideSlip):
    """A wheel whose side force was not compared: nothing tells how soil yields sideways, nor if
    the wheel digs as it slides.
    """

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        return tuple(p for p in super().parameters() if p.name not in ("digging", "across"))
