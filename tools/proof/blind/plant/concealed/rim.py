"""Effects of the contact: where stress stands on the rim and how much shear it mobilises."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.contact import Rim
from gritd.tools.proof.blind.plant.effect import Facts, PlantEffect
from gritd.tools.proof.blind.plant.scene import Scene

USUAL = 0.02  # [m/s] speed at which the soil was measured


@dataclass(frozen=True)
class ThermalRate(PlantEffect):
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
class InertialRate(PlantEffect):
    """Strength times 1 + s (I − 1)/(I + 1): grains that are sheared fast and pressed lightly rub
    more. I = (u/u₀) √(W₀/W), u the speed at which the rim slides on the soil, u₀ = 6 mm/s.

    Source: friction of granular flow over its inertial number, Jop, Forterre, Pouliquen (2006),
    Nature 441, 727-730.
    """

    weight: float = 60.0  # W₀ [N]

    name, most = "rate_dependent_shear", 0.2

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, facts.weight)

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        sliding = np.abs(scene.rim_speed - scene.motion.speed) / (0.3 * USUAL)
        pressed = np.maximum(scene.motion.weight, 0.1 * self.weight) / self.weight
        inertial = sliding / np.sqrt(pressed)
        growth = 1.0 + self.strength * (inertial - 1.0) / (inertial + 1.0)
        return replace(rim, strength=rim.strength * growth)


@dataclass(frozen=True)
class SharedRebound(PlantEffect):
    """Soil springs back by a share κ of the sinkage: cos θ₂ = 1 − κ (1 − cos θ₁).

    Source: Ishigami, Miwa, Nagatani, Yoshida (2007), J. Field Robotics 24, 233-250, wheel sinkage
        ratio.
    """

    name, most = "rear_contact", 0.3

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        return replace(rim, rebound=rim.rebound + self.strength)


@dataclass(frozen=True)
class LoosenedRebound(PlantEffect):
    """κ (W₀/W)^0.3/(1 + (i/i₀)²): sheared soil springs back less, and so does deeply pressed soil.

    Source: unloading of pressed soil is stiffer the deeper it was pressed, Wong (2008), Theory of
    Ground Vehicles, 4th ed., section 2.4.2; the fall with slip was chosen here.
    """

    slip: float = 0.8  # i₀
    weight: float = 60.0  # W₀ [N]

    name, most = "rear_contact", 0.35

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.5, 1.5)), facts.weight)

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        pressed = (self.weight / np.maximum(scene.motion.weight, 0.1 * self.weight)) ** 0.3
        loosened = 1.0 / (1.0 + (np.clip(scene.slip, 0.0, 1.0) / self.slip) ** 2)
        return replace(rim, rebound=rim.rebound + self.strength * loosened * pressed)


@dataclass(frozen=True)
class RoundHump(PlantEffect):
    """τ over its residual has a hump P (j/k) e^(1 − j/k). Source: form after Oida (1979); see
    `contact.mobilised`.
    """

    name, most = "shear_peak", 0.8

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        return replace(rim, overshoot=rim.overshoot + self.strength)


@dataclass(frozen=True)
class BrittleHump(PlantEffect):
    """τ over its residual has a hump 2 P tanh(2j/k)/cosh(2j/k). Source: form after Kacigin and
    Guskov (1968); see `contact.mobilised`.
    """

    name, most = "shear_peak", 0.8

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        return replace(rim, brittle=rim.brittle + self.strength)


@dataclass(frozen=True)
class LevellingPeak(PlantEffect):
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


@dataclass(frozen=True)
class PressedPeak(PlantEffect):
    """θₘ/θ₁ = ½ + s (a + (1 − a) √i)(W/W₀)^0.2: further under a heavier wheel.

    Source: the peak of Onafeko and Reece (1967), J. Terramechanics 4(1), 59-80, moves with slip
    and with load; the powers were chosen here.
    """

    share: float = 0.5  # a
    weight: float = 60.0  # W₀ [N]

    name, signed, most = "stress_peak_shift", True, 0.25

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), float(rng.uniform(0.0, 1.0)), facts.weight)

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        slip = np.sqrt(np.clip(scene.slip, 0.0, 1.0))
        pressed = (np.maximum(scene.motion.weight, 1.0) / self.weight) ** 0.2
        moved = self.strength * (self.share + (1.0 - self.share) * slip) * pressed
        return replace(rim, peak=rim.peak + moved)


@dataclass(frozen=True)
class PolishedRim(PlantEffect):
    """The rim grips lightly pressed soil well, and heavily pressed soil less: strength times 1 −
    s σ/(σ + σ₀). See `contact.sheared`.
    """

    name, most = "rim_friction", 0.4

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        return replace(rim, polish=self.strength)


@dataclass(frozen=True)
class SlidingRim(PlantEffect):
    """Shear builds up in the soil as ever, but the rim gives way the more, the nearer it comes to
    1 − s of the strength. See `contact.mobilised`.
    """

    name, most = "rim_friction", 0.4

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        return replace(rim, sliding=self.strength)


@dataclass(frozen=True)
class SkewedWheel(PlantEffect):
    """The wheel's plane is turned by β from the rails on which it travels: the rim slides sideways,
    too, v cos β is left along the plane, and the shear stress has the direction of the sliding. See
    `contact.sheared`.
    """

    name, signed, most = "side_slip", True, 0.35

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        return replace(rim, skew=rim.skew + float(np.tan(self.strength)))


@dataclass(frozen=True)
class FrictionCircle(PlantEffect):
    """F_y = 0.7 W tanh 3β, and √(1 − tanh² 3β) of the wheel's grip is left along its plane.

    Source: one circle of friction for both directions, Schwanghart (1968), J. Terramechanics 5(1),
    9-29.
    """

    name, signed, most = "side_slip", True, 0.3

    def forces(self, scene: Scene) -> Scene:
        share = float(np.tanh(3.0 * self.strength))
        lost = (1.0 - float(np.sqrt(1.0 - share**2))) * scene.torque
        return replace(
            scene,
            side=scene.side + 0.7 * share * scene.carried * scene.moving * scene.direction,
            torque=scene.torque - lost,
            pull=scene.pull - lost / scene.rig.radius,
        )


EFFECTS: tuple[type[PlantEffect], ...] = (
    ThermalRate,
    InertialRate,
    SharedRebound,
    LoosenedRebound,
    RoundHump,
    BrittleHump,
    LevellingPeak,
    PressedPeak,
    PolishedRim,
    SlidingRim,
    SkewedWheel,
    FrictionCircle,
)
