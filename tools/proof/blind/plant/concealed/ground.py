"""Effects of the soil itself: strength and stiffness that change with time, place, pass, speed and
slip.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.contact import PlantSoil
from gritd.tools.proof.blind.plant.effect import Facts, PlantEffect
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Scene

SLOWEST = 1e-3  # [m/s] keeps a standing wheel's rates finite
USUAL = 0.02  # [m/s] at which the soil was measured


@dataclass(frozen=True)
class DiffusiveDrying(PlantEffect):
    """c (1 + a √(t/t₀)), t₀ the length of one run: loss limited by the soil grows with the root of
    time.

    Source: Black, Gardner, Thurtell (1969), Soil Sci. Soc. Am. Proc. 33, 655-660 (evaporation from
        a drying bed).
    """

    span: float = 30.0  # t₀ [s]

    name, signed, most = "drying_cohesion", True, 0.35

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), facts.duration)

    def soil(self, ground: PlantSoil, scene: Scene) -> PlantSoil:
        factor = 1.0 + self.strength * np.sqrt(scene.motion.time / self.span)
        return replace(ground, cohesion=ground.cohesion * np.maximum(factor, 0.02))


@dataclass(frozen=True)
class SteadyDrying(PlantEffect):
    """c (1 + a t/t₀), not below a fiftieth of c, t₀ three runs long: loss limited by the air is
    steady.

    Source: constant-rate stage of evaporation, Hillel (1998), Environmental Soil Physics.
    """

    span: float = 90.0  # t₀ [s]

    name, signed, most = "drying_cohesion", True, 0.5

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), 3.0 * facts.duration)

    def soil(self, ground: PlantSoil, scene: Scene) -> PlantSoil:
        factor = 1.0 + self.strength * scene.motion.time / self.span
        return replace(ground, cohesion=ground.cohesion * np.maximum(factor, 0.02))


@dataclass(frozen=True)
class PowerOfPasses(PlantEffect):
    """K Nᵃ, c N^(a/2), k N^(−a/3) on the N-th pass.

    Source: power law of repeated passes, Abebe, Tanaka, Yamazaki (1989), J. Terramechanics 26,
        275-283.
    """

    name, most = "multipass", 0.8

    def soil(self, ground: PlantSoil, scene: Scene) -> PlantSoil:
        growth = float(scene.motion.passes) ** self.strength
        return replace(
            ground,
            modulus=ground.modulus * growth,
            cohesion=ground.cohesion * growth**0.5,
            shear_modulus=ground.shear_modulus * growth ** (-1.0 / 3.0),
        )


@dataclass(frozen=True)
class LogarithmOfPasses(PlantEffect):
    """K (1 + a ln N), tan φ (1 + a/10 ln N), n (1 − a/20 ln N) on the N-th pass.

    Source: density grows with the logarithm of the number of passes, Koolen and Kuipers (1983),
    Agricultural Soil Mechanics.
    """

    name, most = "multipass", 1.2

    def soil(self, ground: PlantSoil, scene: Scene) -> PlantSoil:
        growth = self.strength * float(np.log(scene.motion.passes))
        return replace(
            ground,
            modulus=ground.modulus * (1.0 + growth),
            tan_phi=ground.tan_phi * (1.0 + 0.1 * growth),
            exponent=ground.exponent * (1.0 - 0.05 * growth),
        )


@dataclass(frozen=True)
class LogarithmicRate(PlantEffect):
    """K [1 + m ln((u + v₁)/(v₀ + v₁))], u = v (W/W₀)^0.3, v of the carriage: a heavier wheel stands
    deeper and presses the soil down at a steeper angle.

    Source: logarithmic rate law of dry granular penetration, in place of Grahn's power law (1991);
    the power of the weight was chosen here.
    """

    weight: float = 60.0  # W₀ [N]

    name, most = "rate_dependent_sinkage", 0.2

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, facts.weight)

    def soil(self, ground: PlantSoil, scene: Scene) -> PlantSoil:
        steep = (np.maximum(scene.motion.weight, 1.0) / self.weight) ** 0.3
        gain = np.log((np.abs(scene.motion.speed) * steep + SLOWEST) / (USUAL + SLOWEST))
        return replace(ground, modulus=ground.modulus * np.maximum(1.0 + self.strength * gain, 0.1))


@dataclass(frozen=True)
class RootRate(PlantEffect):
    """K [1 + m ((u/u₀)^(1/q) − 1)], u the rim's speed, q = 2 … 4.

    Source: Cowper and Symonds (1957), Brown University Technical Report 28: overstress goes with a
    root of the rate.
    """

    root: float = 3.0  # q

    name, most = "rate_dependent_sinkage", 0.5

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(2.0, 4.0)))

    def soil(self, ground: PlantSoil, scene: Scene) -> PlantSoil:
        rate = (np.abs(scene.rim_speed) + SLOWEST) / (USUAL + SLOWEST)
        gain = rate ** (1.0 / self.root) - 1.0
        return replace(ground, modulus=ground.modulus * np.maximum(1.0 + self.strength * gain, 0.1))


@dataclass(frozen=True)
class CurvedSlipSinkage(PlantEffect):
    """n = n₀ + s (a i + (1 − a) i²), a up to a half: slip-sinkage that bends with slip.

    Source: the power law of Ding et al. (2011), J. Terramechanics 48, 27-45, carried to second
    order; the share of the orders was chosen here.
    """

    share: float = 0.25  # a

    name, most = "slip_sinkage", 0.25

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.0, 0.5)))

    def soil(self, ground: PlantSoil, scene: Scene) -> PlantSoil:
        slip = np.clip(scene.slip, 0.0, 1.0)
        more = self.strength * (self.share * slip + (1.0 - self.share) * slip**2)
        return replace(ground, exponent=ground.exponent + more)


@dataclass(frozen=True)
class SweptSlipSinkage(PlantEffect):
    """Sinkage of the axle z − h ln(1 − i) (W/W₀)^½, i up to 0.8: each part of the rim that passes
    takes a layer with it, a thicker one under a heavier wheel.

    The forces stay: the rut is deeper, the contact is the same. Source: chosen here.
    """

    weight: float = 60.0  # W₀ [N]

    name, most = "slip_sinkage", 0.006

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, facts.weight)

    def forces(self, scene: Scene) -> Scene:
        slip = np.clip(scene.slip, 0.0, 0.8)
        heavy = np.sqrt(np.maximum(scene.motion.weight, 0.0) / self.weight)
        dug = -self.strength * np.log(1.0 - slip) * heavy * scene.moving * (scene.sinkage > 0.0)
        return replace(scene, sinkage=scene.sinkage + dug)


@dataclass(frozen=True)
class SoilStretch(PlantEffect, ABC):
    """c (1 + a w), tan φ (1 + b w) on a stretch of the bed; its forms give w(x)."""

    friction: float = 0.3  # b over a
    middle: float = 0.3  # [m]
    half: float = 0.1  # [m]
    flank: float = 0.03  # [m]

    name, signed, most = "soil_patch", True, 0.6

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        middle, half = rng.uniform(0.3, 0.7) * facts.length, rng.uniform(0.12, 0.25) * facts.length
        share, flank = rng.uniform(0.0, 0.5), rng.uniform(0.01, 0.04)
        return cls(cls.most * cls.sign(rng), float(share), float(middle), float(half), float(flank))

    @abstractmethod
    def inside(self, place: Array) -> Array:
        """w (n,) at places on the bed (n,) [m]."""

    def soil(self, ground: PlantSoil, scene: Scene) -> PlantSoil:
        change = self.strength * self.inside(scene.motion.travel)
        return replace(
            ground,
            cohesion=ground.cohesion * (1.0 + change),
            tan_phi=ground.tan_phi * (1.0 + self.friction * change),
        )


@dataclass(frozen=True)
class FlankedPatch(SoilStretch):
    """w is a trapezoid: a stretch with straight flanks, as filled in by hand."""

    def inside(self, place: Array) -> Array:
        """w (n,), 0 … 1, at places on the bed (n,) [m]; ½ at `half` from the middle."""
        away = np.abs(place - self.middle) - self.half
        return np.asarray(np.clip(0.5 - away / self.flank, 0.0, 1.0))


@dataclass(frozen=True)
class RoundPatch(SoilStretch):
    """w is a bell e^(−((x − x₀)/l)²): water that spread from one spot."""

    def inside(self, place: Array) -> Array:
        """w (n,), 0 … 1, at places x on the bed (n,) [m]; l is `half`."""
        return np.asarray(np.exp(-(((place - self.middle) / self.half) ** 2)))


EFFECTS: tuple[type[PlantEffect], ...] = (
    DiffusiveDrying,
    SteadyDrying,
    PowerOfPasses,
    LogarithmOfPasses,
    LogarithmicRate,
    RootRate,
    CurvedSlipSinkage,
    SweptSlipSinkage,
    FlankedPatch,
    RoundPatch,
)
