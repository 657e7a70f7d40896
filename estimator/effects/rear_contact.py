"""Contact behind bottom dead centre."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import ContactLaw, Situation


@dataclass(frozen=True)
class RearContact(Effect):
    """Soil springs back behind the wheel and still touches it past bottom dead centre.

    θ₂ = −(c₃ + c₄ i) θ₁ ≤ 0, in the rear zone of Eq. (4) and in the integrals (8)-(10)

    Source: Wong and Reece (1967), J. Terramechanics 4(1), 81-98; Ishigami et al. (2007), J. Field
    Robotics 24, 233-250, where the ratio depends on soil, rim and slip.
    """

    ratio: float = strength("exit over entry angle, c₃", "", typical=0.25, low=0.0, high=1.0)
    slip_ratio: float = strength("added to c₃ with slip, c₄", "", typical=0.2, low=-1.0, high=1.0)

    stage = "contact"
    fingerprint = Fingerprint(
        "sinkage",
        "load",
        "rides higher, the more the heavier; torque and drawbar pull rise; c seems larger than it "
        "is",
    )
    confusable_with = told_apart(
        stress_peak_shift="penetration", multipass="penetration", shear_peak="slip_step"
    )

    def contact(self, law: ContactLaw, situation: Situation) -> ContactLaw:
        ratio = np.maximum(self.ratio + self.slip_ratio * situation.slip, 0.0)
        return replace(law, theta_2_ratio=law.theta_2_ratio + ratio)
