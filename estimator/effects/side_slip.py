"""A wheel that does not point where it goes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import ContactLaw, Situation


@dataclass(frozen=True)
class SideSlip(Effect):
    """The wheel is toed in or out, so it slides sideways too and less shear strength is left along
    its plane.

    τ_x = τ(j) j_x/j,   j² = j_x² + j_y²,   j_y = r (v/rω)(θ₁ − θ) tan β,   j_x by Eq. (6)

    Source: Ishigami, Miwa, Nagatani, Yoshida (2007), J. Field Robotics 24, 233-250, Eq. (9); shear
    stress along the resultant displacement.
    """

    angle: float = strength(
        "angle between wheel and travel, β", "rad", typical=0.35, low=0.0, high=1.4
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
        return replace(law, side_slip=law.side_slip + float(np.tan(self.angle)))
