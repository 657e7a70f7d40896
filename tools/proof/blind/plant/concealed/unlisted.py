"""Physics that no library lists, for which the right answer is that none of the listed effects
explains it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.effect import Facts, PlantEffect
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt, Scene


@dataclass(frozen=True)
class CableDrag(PlantEffect):
    """The cable chain pulls back in proportion to how far it is drawn out: DP − F x/L."""

    length: float = 1.0

    name, most = "cable_drag", 10.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.2 * facts.weight, facts.length)

    def forces(self, scene: Scene) -> Scene:
        return replace(scene, pull=scene.pull - self.strength * scene.motion.travel / self.length)


@dataclass(frozen=True)
class SurfaceWaves(PlantEffect):
    """The raked bed is wavy: the potentiometer reads its height, the pull its grade."""

    wavelength: float = 0.15  # [m]
    phase: float = 0.0

    name, most = "surface_waves", 0.004

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(
            cls.most, float(rng.uniform(0.15, 0.45)) * facts.length, float(rng.uniform(0.0, 6.28))
        )

    def forces(self, scene: Scene) -> Scene:
        number = 2.0 * np.pi / self.wavelength
        angle = number * scene.motion.travel + self.phase
        grade = self.strength * number * np.cos(angle)
        depth = scene.sinkage - self.strength * np.sin(angle)
        return replace(scene, pull=scene.pull - scene.carried * grade, sinkage=depth)


@dataclass(frozen=True)
class MagneticSaturation(PlantEffect):
    """Iron saturates: torque K_t I (1 − (I/I_s)²); strength is the shortfall at the typical
    current.
    """

    typical: float = 1.0

    name, most = "magnetic_saturation", 0.25

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, facts.current)

    def drawn_current(self, current: Array, scene: Scene) -> Array:
        """True current (n,) [A] from that of an ideal motor (n,) [A], by iteration. At least 0.4 of
        K_t is left.
        """
        bend, amperes = self.strength / self.typical**2, current
        for _ in range(30):
            amperes = current / np.maximum(1.0 - np.minimum(bend * amperes**2, 0.6), 0.4)
        return amperes


@dataclass(frozen=True)
class BuildingVibration(PlantEffect):
    """A slow machine next door shakes the bed: a sine in time in the drawbar pull."""

    period: float = 2.0  # [s]

    name, most = "building_vibration", 5.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.15 * facts.weight, float(rng.uniform(0.8, 4.0)))

    def sensed(self, felt: Felt) -> Felt:
        wave = self.strength * np.sin(2.0 * np.pi * felt.scene.motion.time / self.period)
        return felt.read(pull=felt.pull + wave)


@dataclass(frozen=True)
class RailJoint(PlantEffect):
    """Beyond a joint of the rails the carriage runs with more friction, which the force sensor
    feels.
    """

    joint: float = 0.3  # [m]

    name, signed, most = "rail_joint", True, 5.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.12 * facts.weight * cls.sign(rng), float(rng.uniform(0.3, 0.7)) * facts.length)

    def forces(self, scene: Scene) -> Scene:
        beyond = 0.5 + 0.5 * np.tanh((scene.motion.travel - self.joint) / 0.005)
        return replace(scene, pull=scene.pull - self.strength * beyond)


@dataclass(frozen=True)
class Thixotropy(PlantEffect):
    """Soil at rest gains torque resistance that shearing wears off: T (1 + a e^(−s/s₀)), s the path
    of the rim.
    """

    wear: float = 0.1  # s₀ [m]

    name, most = "thixotropy", 0.4

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.1, 0.3)) * facts.length)

    def forces(self, scene: Scene) -> Scene:
        path = np.cumsum(np.abs(scene.rim_speed)) * scene.motion.step
        gain = self.strength * np.exp(-path / self.wear)
        return replace(scene, torque=scene.torque * (1.0 + gain))


@dataclass(frozen=True)
class ShearBands(PlantEffect):
    """Soil fails in bands: torque and pull swell and fall once each time the rim has slid by l.

    T (1 + a g), g a saw of the sliding path over l.
    """

    spacing: float = 0.01  # l [m]

    name, most = "shear_bands", 0.4

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.01, 0.04)))

    def forces(self, scene: Scene) -> Scene:
        path = np.cumsum(np.abs(scene.rim_speed - scene.motion.speed)) * scene.motion.step
        swell = scene.torque * self.strength * (np.mod(path / self.spacing, 1.0) - 0.5)
        return replace(
            scene,
            torque=scene.torque + swell,
            pull=scene.pull + swell / scene.rig.radius,
        )


@dataclass(frozen=True)
class CableTwist(PlantEffect):
    """The motor's cable winds up with the wheel: torque M ψ/2π, both ways."""

    name, most = "cable_twist", 0.5

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(0.3 * facts.torque)

    def loss(self, scene: Scene) -> Array:
        """M ψ/2π (n,) at the axle [N·m], ψ the angle of the wheel."""
        return np.asarray(self.strength * scene.motion.turn / (2.0 * np.pi))


EFFECTS: tuple[type[PlantEffect], ...] = (
    CableDrag,
    SurfaceWaves,
    MagneticSaturation,
    BuildingVibration,
    RailJoint,
    Thixotropy,
    ShearBands,
    CableTwist,
)
