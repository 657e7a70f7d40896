"""Effects of the contact: where stress stands on the rim and how much shear it mobilises."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.contact import Rim
from gritd.tools.proof.blind.plant.effect import Effect, Facts
from gritd.tools.proof.blind.plant.scene import Scene


@dataclass(frozen=True)
class RateDependentShear(Effect):
    """Strength times 1 + (λ/ln 10) [asinh(u/u₀) − asinh(v₀/u₀)], u the rim's speed, v₀ = 20 mm/s,
    u₀ = 2 mm/s.

    Source: rate process theory (Eyring): strength goes with the inverse hyperbolic sine of the
    rate; Mitchell and Soga (2005), Fundamentals of Soil Behavior, 3rd ed., ch. 12.
    """

    name, most = "rate_dependent_shear", 0.15

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        decades = (np.arcsinh(np.abs(scene.rim_speed) / 2e-3) - np.arcsinh(10.0)) / np.log(10.0)
        return replace(rim, strength=rim.strength * (1.0 + self.strength * decades))


@dataclass(frozen=True)
class RearContact(Effect):
    """Soil springs back by a share κ of the sinkage: cos θ₂ = 1 − κ (1 − cos θ₁).

    Source: Ishigami, Miwa, Nagatani, Yoshida (2007), J. Field Robotics 24, 233-250, wheel sinkage
        ratio.
    """

    name, most = "rear_contact", 0.3

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        return replace(rim, rebound=self.strength)


@dataclass(frozen=True)
class ShearPeak(Effect):
    """τ over its residual has a hump P (j/k) e^(1 − j/k). Source: form after Oida (1979); see
    `contact.mobilised`.
    """

    name, most = "shear_peak", 0.8

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        return replace(rim, overshoot=self.strength)


@dataclass(frozen=True)
class StressPeakShift(Effect):
    """θₘ/θ₁ = ½ + s [a + (1 − a) tanh(2 i)]: forward with slip, levelling off.

    Source: data of Wong and Reece (1967), J. Terramechanics 4(1), 81-98, which bend down at high
        slip.
    """

    share: float = 0.5  # a

    name, signed, most = "stress_peak_shift", True, 0.25

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), float(rng.uniform(0.0, 1.0)))

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        moved = self.strength * (self.share + (1.0 - self.share) * np.tanh(2.0 * scene.slip))
        return replace(rim, peak=rim.peak + moved)


EFFECTS: tuple[type[Effect], ...] = (RateDependentShear, RearContact, ShearPeak, StressPeakShift)
