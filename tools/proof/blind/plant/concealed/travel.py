"""Effects of the way travelled: wheel and soil follow a change over some centimetres."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.effect import Facts, PlantEffect
from gritd.tools.proof.blind.plant.memory import lagged, mean_before
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Scene

SETTLING = 1e-3  # [m/s] way that a rest is worth
DRIVEN = 0.9  # of `Scene.moving`, below which the soil's forces at rest tell nothing


def relaxed(scene: Scene, follow: Callable[[Array], Array]) -> Scene:
    """The scene with its forces and its sinkage led through `follow`, (n,) to (n,).

    Forces are followed as they are in motion: at rest and through a reversal they keep their size.
    """
    way, down = scene.direction * scene.moving, scene.carried > 1.0
    torque, pull = _held(scene.torque, way), _held(scene.pull, way)
    depth = np.maximum(scene.sinkage, 0.0)

    return replace(
        scene,
        torque=scene.torque + (follow(torque) - torque) * way,
        pull=scene.pull + (follow(pull) - pull) * way,
        sinkage=scene.sinkage + (follow(depth) - depth) * down,
    )


def _held(values: Array, way: Array) -> Array:
    """Signed values as sizes, those in motion carried on through rests."""
    known = np.flatnonzero(np.abs(way) > DRIVEN)
    if not known.size:
        return np.zeros(values.size)
    latest = known[np.maximum(np.searchsorted(known, np.arange(values.size), "right") - 1, 0)]
    return np.asarray(values[latest] / way[latest])


def steps_of(scene: Scene) -> Array:
    """Way of the carriage from one sample to the next (n,) [m]; soil goes on settling at rest."""
    moved = np.abs(np.diff(scene.motion.travel, prepend=scene.motion.travel[0]))
    return np.asarray(moved + SETTLING * scene.motion.step)


@dataclass(frozen=True)
class SecondOrderRelaxation(PlantEffect):
    """Torque, pull and sinkage follow over λ of travel, by two lags of λ/2 one after the other.

    Source: relaxation length of a rolling wheel, Pacejka (2012), Tire and Vehicle Dynamics, ch. 5,
    here of second order: contact and bow wave.
    """

    name, most = "contact_relaxation", 0.1

    def forces(self, scene: Scene) -> Scene:
        way, half = steps_of(scene), 0.5 * self.strength
        return relaxed(scene, lambda values: lagged(lagged(values, way, half), way, half))


@dataclass(frozen=True)
class RollingContact(PlantEffect):
    """Torque and pull are means over the last a r sin θ₁ of travel, the sinkage over as much again:
    soil under the rim was sheared by all slips since it was entered.

    Source: strips that carry their shear along, as in Krenn and Hirzinger (2009), ISTVS: the length
    of the contact is the memory.
    """

    name, most = "contact_relaxation", 2.5

    def forces(self, scene: Scene) -> Scene:
        path = np.cumsum(steps_of(scene))
        touched = scene.rig.radius * np.sin(np.median(scene.theta_1))
        return relaxed(scene, lambda values: mean_before(values, path, self.strength * touched))


@dataclass(frozen=True)
class BowWave(PlantEffect):
    """A run begins with f W more pull, which falls as 1 − √(s/(4 λ)) over its way s until it is
    gone, and with the wheel d i higher, d a twentieth of the radius at f = 0.1.

    Source: none published; a heap of one slope is as high as the root of the soil pushed into it.
    """

    length: float = 0.05  # λ [m]

    name, most = "running_in", 0.25

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.03, 0.08)))

    def fading(self, path: Array) -> Array:
        """Share (n,) that is left after a way (n,) [m]."""
        return np.asarray(np.maximum(1.0 - np.sqrt(path / (4.0 * self.length)), 0.0))

    def forces(self, scene: Scene) -> Scene:
        left = self.strength * self.fading(np.cumsum(steps_of(scene))) * scene.moving
        higher = 0.5 * left * scene.rig.radius * np.clip(np.abs(scene.slip), 0.0, 1.0)
        return replace(
            scene,
            pull=scene.pull + left * scene.carried * scene.direction,
            sinkage=np.where(scene.carried > 1.0, scene.sinkage - higher, scene.sinkage),
        )


@dataclass(frozen=True)
class FilledRut(BowWave):
    """The same, half of it falling as e^(−s/λ) and half as e^(−s/(5 λ)): the contact is new after
    its length, the rut is full after several.
    """

    def fading(self, path: Array) -> Array:
        """Share (n,) that is left after ways s (n,) [m]."""
        lengths = (self.length, 5.0 * self.length)
        return np.asarray(0.5 * np.exp(-path / lengths[0]) + 0.5 * np.exp(-path / lengths[1]))


EFFECTS: tuple[type[PlantEffect], ...] = (SecondOrderRelaxation, RollingContact, BowWave, FilledRut)
