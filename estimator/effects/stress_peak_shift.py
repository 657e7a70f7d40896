"""Place of the stress peak on the rim."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import ContactLaw, Situation


@dataclass(frozen=True)
class StressPeakShift(Effect):
    """The normal stress peaks elsewhere on the rim than configured, and the peak moves forward with
    slip.

    θₘ = (c₁ + Δc₁ + (c₂ + Δc₂) i) θ₁, Eq. (5)

    Source: Wong and Reece (1967), J. Terramechanics 4(1), 81-98: c₁ ≈ 0.18-0.43, c₂ ≈ 0.32-0.41 in
    sand.
    """

    share: float = strength("added to c₁", "", typical=0.1, low=-1.0, high=1.0)
    slip_share: float = strength("added to c₂", "", typical=0.2, low=-1.0, high=1.0)

    stage = "contact"
    fingerprint = Fingerprint(
        "sinkage", "sinkage", "sinkage and drawbar pull change, more at high slip; torque much less"
    )
    confusable_with = told_apart(
        rear_contact="penetration", slip_sinkage="penetration", shear_peak="slip_step"
    )

    def contact(self, law: ContactLaw, situation: Situation) -> ContactLaw:
        return replace(
            law, theta_m_ratio=law.theta_m_ratio + self.share + self.slip_share * situation.slip
        )
