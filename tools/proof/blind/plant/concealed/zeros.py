"""Zeros and scales that are off: of the shunt, of the potentiometer, of the force sensor."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.effect import Facts, PlantEffect
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt


@dataclass(frozen=True)
class WarmingOffset(PlantEffect):
    """The amplifier reads I₀ (1 − e^(−t/τ)/5) more than there is: nearly all of it from the start,
    the rest as it warms.
    """

    warming: float = 100.0  # τ [s]

    name, signed, most = "current_offset", True, 0.4

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.3 * facts.current * cls.sign(rng), float(rng.uniform(50.0, 200.0)))

    def sensed(self, felt: Felt) -> Felt:
        grown = 1.0 - 0.2 * np.exp(-felt.scene.motion.time / self.warming)
        return felt.read(current=felt.current + self.strength * grown)


@dataclass(frozen=True)
class BentOffset(PlantEffect):
    """The amplifier reads I₀ more at rest and 0.9 I₀ at the usual current: its curve is bent."""

    usual: float = 0.75  # [A]

    name, signed, most = "current_offset", True, 0.4

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.3 * facts.current * cls.sign(rng), facts.current)

    def sensed(self, felt: Felt) -> Felt:
        bent = 1.0 - 0.1 * np.tanh(np.abs(felt.current) / self.usual) / np.tanh(1.0)
        return felt.read(current=felt.current + self.strength * bent)


@dataclass(frozen=True)
class RakedDatum(PlantEffect):
    """The potentiometer's zero is z₀ off the surface, which is raked in ridges of z₀/20."""

    wavelength: float = 0.03  # [m]

    name, signed, most = "sinkage_datum", True, 0.005

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), float(rng.uniform(0.02, 0.06)))

    def sensed(self, felt: Felt) -> Felt:
        ridges = 0.05 * np.cos(2.0 * np.pi * felt.scene.motion.travel / self.wavelength)
        return felt.read(sinkage=felt.sinkage + self.strength * (1.0 + ridges))

    def coinciding(self) -> dict[str, float]:
        return {"offset": self.strength}


@dataclass(frozen=True)
class ScatteredDatum(PlantEffect):
    """The zero is set anew before each run, each time z₀ off, give or take a tenth of it."""

    phase: float = 0.0

    name, signed, most = "sinkage_datum", True, 0.005

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), float(rng.uniform(0.0, 2.0 * np.pi)))

    def sensed(self, felt: Felt) -> Felt:
        scatter = 0.1 * float(np.sin(self.phase + 12.9898 * felt.scene.motion.time[0]))
        return felt.read(sinkage=felt.sinkage + self.strength * (1.0 + scatter))


@dataclass(frozen=True)
class TiltedPotentiometer(PlantEffect):
    """Its string runs askew: z (1 + g)(1 − z/20 z₀), z₀ the usual sinkage. Source: geometry, to
    second order.
    """

    usual: float = 0.01  # z₀ [m]

    name, signed, most = "sinkage_gain", True, 0.25

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), facts.sinkage)

    def sensed(self, felt: Felt) -> Felt:
        bent = 1.0 + self.strength * (1.1 - 0.1 * felt.sinkage / self.usual)
        return felt.read(sinkage=felt.sinkage * bent)


@dataclass(frozen=True)
class LoadedPotentiometer(PlantEffect):
    """The converter loads the potentiometer's divider: z (1 + g (1 − e^(−2z/z₀))/0.86).

    Source: a loaded divider's curve bends; the exponential was chosen here.
    """

    usual: float = 0.01  # z₀ [m]

    name, signed, most = "sinkage_gain", True, 0.25

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), 0.7 * facts.sinkage)

    def sensed(self, felt: Felt) -> Felt:
        bent = -np.expm1(-2.0 * np.maximum(felt.sinkage, 0.0) / self.usual) / 0.86
        return felt.read(sinkage=felt.sinkage * (1.0 + self.strength * bent))


@dataclass(frozen=True)
class Drift(PlantEffect, ABC):
    """The zero of one channel creeps with time, by `strength` over a run; its forms say how. Each
    run begins where the last one ended.
    """

    channel: str = "sinkage"
    span: float = 30.0  # length of a run [s]
    pace: float = 100.0  # of the form's own time [s]

    name, signed, most = "sensor_drift", True, 1.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        sizes = {"sinkage": 0.003, "pull": 0.1 * facts.weight, "torque": 0.15 * facts.torque}
        channel = str(rng.choice(tuple(sizes)))
        size, pace = sizes[channel] * cls.sign(rng), float(rng.uniform(2.0, 8.0)) * facts.duration
        return cls(size, channel, facts.duration, pace)

    @abstractmethod
    def crept(self, time: Array) -> Array:
        """Share of `strength` that the zero has crept (n,), at times (n,) since the campaign began
        [s].
        """

    def sensed(self, felt: Felt) -> Felt:
        crept = self.strength * self.crept(felt.scene.motion.time)
        return felt.read(**{self.channel: getattr(felt, self.channel) + crept})


@dataclass(frozen=True)
class RoomDrift(Drift):
    """With the temperature of the room, which swings: sin(t/τ) τ over a run."""

    def crept(self, time: Array) -> Array:
        """sin(t/τ) τ/T (n,), dimensionless, at times t (n,) [s]; T is the length of a run."""
        return np.asarray(np.sin(time / self.pace) * self.pace / self.span)


@dataclass(frozen=True)
class GluedDrift(Drift):
    """With the logarithm of time, as glue under a strain gauge creeps: ln(1 + t/τ) τ over a run."""

    def crept(self, time: Array) -> Array:
        """ln(1 + t/τ) τ/T (n,), dimensionless, at times t (n,) [s]; T is the length of a run."""
        return np.asarray(np.log1p(time / self.pace) * self.pace / self.span)


EFFECTS: tuple[type[PlantEffect], ...] = (
    WarmingOffset,
    BentOffset,
    RakedDatum,
    ScatteredDatum,
    TiltedPotentiometer,
    LoadedPotentiometer,
    RoomDrift,
    GluedDrift,
)
