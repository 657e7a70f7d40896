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
from gritd.estimator.terramechanics.earth_pressure import blade_resistance
from gritd.estimator.terramechanics.original import velocity_ratio
from gritd.estimator.terramechanics.soil import Array

UNIT_WEIGHT = 15e3  # of dry sand [N/m³]


@dataclass(frozen=True)
class SideSlip(Effect):
    """The wheel is toed in or out, so it slides sideways too: less shear strength is left along its
    plane, and it digs.

    (τ_x, τ_y) = τ(j) [(1 − m)(j_x, j_y)/j + m (s_x, s_y)/s],   j² = j_x² + j_y²
    j_y = κ r (v/rω)(θ₁ − θ) tan β, j_x by Eq. (6);   s_x = 1 − (v/rω) cos θ,   s_y = (v/rω) tan β
    side force = r b ∫ τ_y dθ + p sin β ∫ R_b(h) dx;   z + d min(1, v/rω) tan β

    The shear stress has the direction of the displacement j (m = 0), or of the sliding s (m = 1).
    The soil may yield sideways by another shear modulus than along the wheel, κ = k_x/k_y, as in
    the source. Soil that a wheel carries aside digs, as that does which it carries back
    (`slip_sinkage`). Before its side wall, which is h deep in the soil from θ = 0 to θ₁, it pushes
    soil as a plane blade does, R_b. Where no side force is compared, κ is 1.5, d and p are 0: what
    shows there is κ tan β, so β is no surer than κ, which its σ does not hold.
    Source: Ishigami, Miwa, Nagatani, Yoshida (2007), J. Field Robotics 24, 233-250, Eq. (9) and
    the resistance at the sides; Wong (2008), Theory of Ground Vehicles, 4th ed., ch. 1: sliding.
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

    pushing: float = shape(
        "share of a plane blade's resistance before the side wall, p",
        "",
        mean=0.0,
        sigma=1.0,
        low=0.0,
        high=5.0,
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
        pushed = self.pushing * float(np.sin(self.angle)) * _blade(situation) * situation.direction
        return replace(
            reaction,
            sinkage=reaction.sinkage + self.digging * slid,
            side_force=reaction.side_force + pushed,
        )

    @classmethod
    def without_side_force(cls) -> type[Effect]:
        return SideSlipInPlane


class SideSlipInPlane(SideSlip):
    """A wheel whose side force was not compared: nothing tells how soil yields sideways, nor if
    the wheel digs as it slides.
    """

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        return tuple(
            p for p in super().parameters() if p.name not in ("digging", "across", "pushing")
        )


def _blade(situation: Balanced) -> Array:
    """Resistance of the front half of the side wall to a push sideways [N]."""
    radius, theta = situation.radius, np.maximum(situation.theta_1, 0.0)
    sine, cosine = np.sin(theta), np.cos(theta)
    area = 0.5 * radius**2 * (theta - sine * cosine)
    moment = 0.5 * radius**3 * (sine - sine**3 / 3.0 - theta * cosine)
    return blade_resistance(area, moment, situation.cohesion, situation.tan_phi, UNIT_WEIGHT)
