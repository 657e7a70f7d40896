"""Effects of the testbed around the wheel: bed, frame, vertical axis, side walls."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.effect import Effect, Facts
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt, Scene


@dataclass(frozen=True)
class BedSlope(Effect):
    """W cos α on the soil, W sin α along the pull; statics. Uphill positive."""

    name, signed, most = "bed_slope", True, 0.08

    def carried(self, weight: Array, scene: Scene) -> Array:
        return weight * float(np.cos(self.strength))

    def forces(self, scene: Scene) -> Scene:
        return replace(scene, pull=scene.pull - scene.carried * float(np.tan(self.strength)))

    def coinciding(self) -> dict[str, float]:
        return {"angle": self.strength}


@dataclass(frozen=True)
class FrameCompliance(Effect):
    """z_read = z + C W/(1 + W/W_h): joints close, so the frame stiffens under load. Source: contact
    stiffening.
    """

    hardening: float = 1e3  # W_h [N]

    name, most = "frame_compliance", 6e-5

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(4.0, 12.0)) * facts.weight)

    def sensed(self, felt: Felt) -> Felt:
        load = np.maximum(felt.scene.carried, 0.0)
        return felt.read(
            sinkage=felt.sinkage + self.strength * load / (1.0 + load / self.hardening)
        )


@dataclass(frozen=True)
class LoadAxisFriction(Effect):
    """The axis holds back by a spring of stiffness F/δ that slips at ±F. The wheel was lowered: it
    starts at +F.

    Source: elasto-plastic (Prandtl) element; Al-Bender, Lampaert, Swevers (2005), IEEE Trans.
    Automatic Control 50, 1883-1887, its single-element case.
    """

    breakaway: float = 2e-4  # δ [m]

    name, most = "load_axis_friction", 8.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(min(cls.most, 0.15 * facts.weight), float(rng.uniform(1e-4, 4e-4)))

    def carried(self, weight: Array, scene: Scene) -> Array:
        if not scene.sinkage.size:
            return weight - self.strength * (weight > 0.0)
        held, state = [], 1.0
        for step in np.diff(scene.sinkage, prepend=scene.sinkage[0]).tolist():
            state = min(max(state + step / self.breakaway, -1.0), 1.0)
            held.append(state)
        return np.asarray(np.maximum(weight - self.strength * np.array(held) * (weight > 0.0), 0.0))

    def coinciding(self) -> dict[str, float]:
        return {"friction": self.strength}


@dataclass(frozen=True)
class SideWallRubbing(Effect):
    """DP − s W against travel: the sideways force of a skewed wheel presses it on the wall.

    Source: Daca, Tremblay, Skonieczny (2023), Microgravity Sci. Technol. 35:6.
    """

    name, most = "side_wall_rubbing", 0.12

    def forces(self, scene: Scene) -> Scene:
        rub = self.strength * scene.carried * np.tanh(scene.motion.speed / 5e-4)
        return replace(scene, pull=scene.pull - rub)

    def coinciding(self) -> dict[str, float]:
        return {"share": self.strength}


EFFECTS: tuple[type[Effect], ...] = (BedSlope, FrameCompliance, LoadAxisFriction, SideWallRubbing)
