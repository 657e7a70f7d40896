"""The shape of a concealed effect. Each acts where its physics acts; off, at strength 0, it changes
nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from gritd.tools.proof.blind.plant.contact import PlantSoil, Rim
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt, Scene, TrueMotion


@dataclass(frozen=True)
class Facts:
    """What shapes are drawn by: how far, long, heavy and fast the campaign is, typically."""

    duration: float  # of a run [s]
    length: float  # of the bed used [m]
    radius: float  # [m]
    weight: float  # [N]
    omega: float  # [rad/s]
    torque: float  # [N·m]
    current: float  # [A]
    sinkage: float  # [m]


@dataclass(frozen=True)
class PlantEffect:
    """One physical effect of one strength; subclasses add shapes as fields, with their draw.

    `most` is the largest strength still plausible on a testbed; `signed` says that it may have
    either sign.
    """

    strength: float

    name: ClassVar[str] = ""  # the library's; several forms share it
    signed: ClassVar[bool] = False
    most: ClassVar[float] = 1.0

    @classmethod
    def meets_soil(cls) -> bool:
        """Whether it changes how the soil carries the wheel."""
        before = ("radius", "soil", "contact", "carried")
        return any(getattr(cls, step) is not getattr(PlantEffect, step) for step in before)

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        """At the largest plausible strength, sign and shapes drawn."""
        return cls(cls.most * cls.sign(rng))

    @classmethod
    def sign(cls, rng: np.random.Generator) -> float:
        return float(rng.choice((-1.0, 1.0))) if cls.signed else 1.0

    def radius(self, radius: Array, motion: TrueMotion) -> Array:
        """Radius below the axle (n,) [m], of that of the effects before (n,) [m]."""
        return radius

    def soil(self, ground: PlantSoil, scene: Scene) -> PlantSoil:
        return ground

    def contact(self, rim: Rim, scene: Scene) -> Rim:
        return rim

    def carried(self, weight: Array, scene: Scene) -> Array:
        """Load on the soil (n,) [N], of the weight (n,). `scene.sinkage` is that of the round
        before, or empty.
        """
        return weight

    def forces(self, scene: Scene) -> Scene:
        """After the soil: torque, pull, carried, sinkage of the scene, in the bed's frame."""
        return scene

    def loss(self, scene: Scene) -> Array | float:
        """Torque that the drivetrain or the wheel's own body takes (n,), at the axle [N·m]."""
        return 0.0

    def drawn_current(self, current: Array, scene: Scene) -> Array:
        """True current (n,) of the motor from that of an ideal one (n,) [A]."""
        return current

    def sensed(self, felt: Felt) -> Felt:
        return felt

    def coinciding(self) -> dict[str, float]:
        """Parameters that `gritd` states in the same terms, by its names; SI."""
        return {}
