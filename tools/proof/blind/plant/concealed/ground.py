"""Effects of the soil itself: strength and stiffness that change with time, place, pass, speed and
slip.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.contact import Ground
from gritd.tools.proof.blind.plant.effect import Effect, Facts
from gritd.tools.proof.blind.plant.scene import Scene

SLOWEST = 1e-3  # [m/s] keeps a standing wheel's rates finite


@dataclass(frozen=True)
class DryingCohesion(Effect):
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

    def soil(self, ground: Ground, scene: Scene) -> Ground:
        factor = 1.0 + self.strength * np.sqrt(scene.motion.time / self.span)
        return replace(ground, cohesion=ground.cohesion * np.maximum(factor, 0.02))


@dataclass(frozen=True)
class Multipass(Effect):
    """K Nᵃ, c N^(a/2), k N^(−a/3) on the N-th pass: density grows with the logarithm of the number
    of passes.

    Source: power law of repeated passes, Abebe, Tanaka, Yamazaki (1989), J. Terramechanics 26,
        275-283.
    """

    name, most = "multipass", 0.8

    def soil(self, ground: Ground, scene: Scene) -> Ground:
        growth = float(scene.motion.passes) ** self.strength
        return replace(
            ground,
            modulus=ground.modulus * growth,
            cohesion=ground.cohesion * growth**0.5,
            shear_modulus=ground.shear_modulus * growth ** (-1.0 / 3.0),
        )


@dataclass(frozen=True)
class RateDependentSinkage(Effect):
    """K [1 + m ln((v + v₁)/(v₀ + v₁))], v of the carriage.

    Source: logarithmic rate law of dry granular penetration, in place of Grahn's power law (1991).
    """

    name, most = "rate_dependent_sinkage", 0.2

    def soil(self, ground: Ground, scene: Scene) -> Ground:
        gain = np.log((np.abs(scene.motion.speed) + SLOWEST) / (0.02 + SLOWEST))
        return replace(ground, modulus=ground.modulus * np.maximum(1.0 + self.strength * gain, 0.1))


@dataclass(frozen=True)
class SlipSinkage(Effect):
    """Sinkage times 1 + s [(1 + i)/(1 − i/2) − 1].

    Source: Lyasko (2010), J. Terramechanics 47, 21-31, where s = 1.
    """

    name, most = "slip_sinkage", 0.8

    def soil(self, ground: Ground, scene: Scene) -> Ground:
        slip = np.clip(scene.slip, 0.0, 1.0)
        deeper = 1.0 + self.strength * ((1.0 + slip) / (1.0 - 0.5 * slip) - 1.0)
        return replace(ground, modulus=ground.modulus * deeper ** (-np.asarray(ground.exponent)))


@dataclass(frozen=True)
class SoilPatch(Effect):
    """c (1 + a w), tan φ (1 + b w) on a stretch with straight flanks: a trapezoid w(x)."""

    friction: float = 0.3  # b over a
    middle: float = 0.3  # [m]
    half: float = 0.1  # [m]
    flank: float = 0.03  # [m]

    name, signed, most = "soil_patch", True, 0.6

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        middle, half = rng.uniform(0.3, 0.7) * facts.length, rng.uniform(0.12, 0.25) * facts.length
        share = float(rng.uniform(0.0, 0.5))
        return cls(
            cls.most * cls.sign(rng),
            share,
            float(middle),
            float(half),
            float(rng.uniform(0.01, 0.04)),
        )

    def soil(self, ground: Ground, scene: Scene) -> Ground:
        away = np.abs(scene.motion.travel - self.middle) - self.half
        inside = self.strength * np.clip(0.5 - away / self.flank, 0.0, 1.0)
        return replace(
            ground,
            cohesion=ground.cohesion * (1.0 + inside),
            tan_phi=ground.tan_phi * (1.0 + self.friction * inside),
        )


EFFECTS: tuple[type[Effect], ...] = (
    DryingCohesion,
    Multipass,
    RateDependentSinkage,
    SlipSinkage,
    SoilPatch,
)
