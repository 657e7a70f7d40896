"""Effects of the testbed around the wheel: bed, frame, vertical axis, side walls."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.effect import Facts, PlantEffect
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt, Scene


@dataclass(frozen=True)
class SaggingSlope(PlantEffect):
    """The testbed is tilted by α, uphill positive, and bends: W cos α on the soil, W tan(α + s x/L)
    from the pull, s a tenth of α. Statics.
    """

    length: float = 1.0  # L [m]

    name, signed, most = "bed_slope", True, 0.08

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), facts.length)

    def carried(self, weight: Array, scene: Scene) -> Array:
        """W cos α (n,) [N] of weights W (n,) [N]."""
        return weight * float(np.cos(self.strength))

    def forces(self, scene: Scene) -> Scene:
        bend = 0.95 + 0.1 * scene.motion.travel / self.length
        return replace(scene, pull=scene.pull - scene.carried * np.tan(self.strength * bend))

    def coinciding(self) -> dict[str, float]:
        return {"angle": self.strength}


@dataclass(frozen=True)
class LeaningAxis(PlantEffect):
    """The bed is level and the vertical axis leans by α: soil takes W/cos α, and the pull's sensor,
    which leans with it, reads DP cos α − W sin α.

    Source: statics of a guided load.
    """

    name, signed, most = "bed_slope", True, 0.08

    def carried(self, weight: Array, scene: Scene) -> Array:
        """W/cos α (n,) [N] of weights W (n,) [N]."""
        return weight / float(np.cos(self.strength))

    def sensed(self, felt: Felt) -> Felt:
        cosine, sine = float(np.cos(self.strength)), float(np.sin(self.strength))
        return felt.read(pull=felt.pull * cosine - felt.load * sine)

    def coinciding(self) -> dict[str, float]:
        return {"angle": self.strength}


@dataclass(frozen=True)
class InclinedBed(PlantEffect, ABC):
    """The bed rises against the rail, by α at first; its forms give how it goes on. The
    potentiometer reads z − rise, and W sin of the grade goes from the pull. Geometry and statics.
    """

    length: float = 1.0  # L [m]

    name, signed, most = "bed_inclination", True, 0.06

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), facts.length)

    @abstractmethod
    def grade(self, place: Array) -> Array:
        """Rise of the surface per way, at places on the bed (n,) [m]."""

    @abstractmethod
    def rise(self, place: Array) -> Array:
        """Height of the surface (n,) over where the bed begins [m], at places (n,) [m]."""

    def forces(self, scene: Scene) -> Scene:
        climb = scene.carried * np.sin(np.arctan(self.grade(scene.motion.travel)))
        return replace(scene, pull=scene.pull - climb)

    def sensed(self, felt: Felt) -> Felt:
        down = felt.scene.carried > 1.0
        return felt.read(sinkage=felt.sinkage - self.rise(felt.scene.motion.travel) * down)


@dataclass(frozen=True)
class HollowBed(InclinedBed):
    """Raked hollow: α x (1 − x/5L)."""

    def grade(self, place: Array) -> Array:
        """α (1 − 2x/5L) (n,), rise per way, at places x on the bed (n,) [m]."""
        return np.asarray(self.strength * (1.0 - 0.4 * place / self.length))

    def rise(self, place: Array) -> Array:
        """α x (1 − x/5L) (n,) [m] at places x on the bed (n,) [m]."""
        return np.asarray(self.strength * place * (1.0 - 0.2 * place / self.length))


@dataclass(frozen=True)
class RollingBed(InclinedBed):
    """Raked in a wave: α (x + L/20 sin 2πx/L)."""

    def grade(self, place: Array) -> Array:
        """α (1 + π/10 cos 2πx/L) (n,), rise per way, at places x on the bed (n,) [m]."""
        wave = 0.1 * np.pi * np.cos(2.0 * np.pi * place / self.length)
        return np.asarray(self.strength * (1.0 + wave))

    def rise(self, place: Array) -> Array:
        """α (x + L/20 sin 2πx/L) (n,) [m] at places x on the bed (n,) [m]."""
        wave = 0.05 * self.length * np.sin(2.0 * np.pi * place / self.length)
        return np.asarray(self.strength * (place + wave))


@dataclass(frozen=True)
class JointedFrame(PlantEffect):
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
class RollingContacts(PlantEffect):
    """z_read = z + C W₀ (W/W₀)^(2/3): the rollers of the guide dent their rails. Source: Hertz."""

    weight: float = 60.0  # W₀ [N]

    name, most = "frame_compliance", 6e-5

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, facts.weight)

    def sensed(self, felt: Felt) -> Felt:
        pressed = (np.maximum(felt.scene.carried, 0.0) / self.weight) ** (2.0 / 3.0)
        return felt.read(sinkage=felt.sinkage + self.strength * self.weight * pressed)


@dataclass(frozen=True)
class StickingAxis(PlantEffect, ABC):
    """The axis holds back by F h, −1 ≤ h ≤ 1 along the path of z; its forms say how h follows. The
    wheel was lowered: h starts at 1.
    """

    breakaway: float = 2e-4  # δ [m]

    name, most = "load_axis_friction", 8.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(min(cls.most, 0.15 * facts.weight), float(rng.uniform(1e-4, 4e-4)))

    @abstractmethod
    def held(self, steps: Array) -> Array:
        """h (n,) after steps of z (n,), given over δ."""

    def pressed(self, scene: Scene) -> Array | float:
        """By how much the guides hold more than F (n,)."""
        return 1.0

    def carried(self, weight: Array, scene: Scene) -> Array:
        """Load on the soil (n,) [N] of weights (n,) [N]: less by F h times `pressed`, a lifted
        wheel's by nothing. Without a sinkage known, h and `pressed` are 1.
        """
        if not scene.sinkage.size:
            return weight - self.strength * (weight > 0.0)

        steps = np.diff(scene.sinkage, prepend=scene.sinkage[0]) / self.breakaway
        back = self.strength * self.held(steps) * self.pressed(scene)
        return np.asarray(np.maximum(weight - back * (weight > 0.0), 0.0))

    def coinciding(self) -> dict[str, float]:
        return {"friction": self.strength}


@dataclass(frozen=True)
class SpringsAxis(StickingAxis):
    """Five springs side by side, each of which slips at F/5, the stiffest after δ/4, the softest
    after 3 δ.

    Source: generalised Maxwell slip; Al-Bender, Lampaert, Swevers (2005), IEEE Trans. Automatic
    Control 50, 1883-1887.
    """

    def held(self, steps: Array) -> Array:
        softness, springs, held = np.geomspace(0.25, 3.0, 5), np.ones(5), []
        for moved in steps.tolist():
            springs = np.clip(springs + moved / softness, -1.0, 1.0)
            held.append(springs.mean())
        return np.array(held)


@dataclass(frozen=True)
class HystereticAxis(StickingAxis):
    """dh = (1 − h²) dz/δ while z goes on, and dz/δ where it turns back; the pull presses the
    guides: F (0.8 + |DP|/W).

    Source: Bouc-Wen element of exponent 2, Wen (1976), J. Eng. Mech. Div. ASCE 102, 249-263.
    """

    def pressed(self, scene: Scene) -> Array | float:
        """0.8 + |DP|/W (n,), dimensionless; the ratio counts up to 1, with W at least 1 N."""
        return 0.8 + np.clip(np.abs(scene.pull) / np.maximum(scene.motion.weight, 1.0), 0.0, 1.0)

    def held(self, steps: Array) -> Array:
        state, held = 1.0, []
        for moved in steps.tolist():
            onward = 1.0 - state * state if state * moved > 0.0 else 1.0
            state = min(max(state + moved * onward, -1.0), 1.0)
            held.append(state)
        return np.array(held)


@dataclass(frozen=True)
class LeaningWall(PlantEffect):
    """DP − s W against travel, growing with slip by half: the skewed wheel pushes to the side as it
    shears.

    Source: rubbing of Daca, Tremblay, Skonieczny (2023), Microgravity Sci. Technol. 35:6; sideways
    force over slip as Ishigami et al. (2007), J. Field Robotics 24, 233-250.
    """

    name, most = "side_wall_rubbing", 0.12

    def forces(self, scene: Scene) -> Scene:
        pressed = scene.carried * (0.85 + 0.5 * np.clip(scene.slip, 0.0, 1.0))
        rub = self.strength * pressed * np.tanh(scene.motion.speed / 5e-4)
        return replace(scene, pull=scene.pull - rub)


@dataclass(frozen=True)
class RoughWall(PlantEffect):
    """DP − s W (1 + e cos 2πx/l) against travel: a wall that is not quite straight, e = 0.3.

    Source: the same rubbing, its normal force from the stiffness of the guide; chosen here.
    """

    wavelength: float = 0.1  # l [m]

    name, most = "side_wall_rubbing", 0.12

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.1, 0.4)) * facts.length)

    def forces(self, scene: Scene) -> Scene:
        wavy = 1.0 + 0.3 * np.cos(2.0 * np.pi * scene.motion.travel / self.wavelength)
        rub = self.strength * scene.carried * wavy * np.tanh(scene.motion.speed / 5e-4)
        return replace(scene, pull=scene.pull - rub)

    def coinciding(self) -> dict[str, float]:
        return {"share": self.strength}


EFFECTS: tuple[type[PlantEffect], ...] = (
    SaggingSlope,
    LeaningAxis,
    HollowBed,
    RollingBed,
    JointedFrame,
    RollingContacts,
    SpringsAxis,
    HystereticAxis,
    LeaningWall,
    RoughWall,
)
