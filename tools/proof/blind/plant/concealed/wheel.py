"""Effects of the wheel's body: what its front, faces, shape and mass add to the rim of Eqs.
(8)-(10).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.concealed.pressure import WEIGHT, passive
from gritd.tools.proof.blind.plant.effect import Facts, PlantEffect
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt, Scene, TrueMotion


@dataclass(frozen=True)
class WallBulldozing(PlantEffect):
    """DP − s b (½ γ z² K_p + 2 c z √K_p): passive earth pressure on a wall as wide as the wheel.

    Source: Terzaghi (1943), Theoretical Soil Mechanics, ch. 7, with Rankine's coefficient.
    """

    name, most = "bulldozing", 1.2

    def forces(self, scene: Scene) -> Scene:
        depth, coefficient = np.maximum(scene.sinkage, 0.0), passive(scene.ground.tan_phi)
        wall = (
            0.5 * WEIGHT * depth** 2 * coefficient
            + 2.0 * scene.ground.cohesion * depth * np.sqrt(coefficient)
        )
        resistance = self.strength * scene.rig.width * wall
        return replace(scene, pull=scene.pull - resistance * scene.direction * scene.moving)


@dataclass(frozen=True)
class BowWaveBulldozing(PlantEffect):
    """DP − s b K_p (½ γ z² + q z): the heap ahead of the wheel weighs on the soil that it pushes,
    q = γ h, h the height of a heap that holds a share of the rut.

    Source: universal earthmoving equation, Reece (1965), Proc. Inst. Mech. Eng. 179(3F), without
    its cohesive term.
    """

    heap: float = 1.0  # h over z

    name, most = "bulldozing", 3.0

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.5, 2.0)))

    def forces(self, scene: Scene) -> Scene:
        depth = np.maximum(scene.sinkage, 0.0)
        wall = WEIGHT * depth**2 * (0.5 + self.heap) * passive(scene.ground.tan_phi)
        resistance = self.strength * scene.rig.width * wall
        return replace(scene, pull=scene.pull - resistance * scene.direction * scene.moving)


@dataclass(frozen=True)
class RestingSidewall(PlantEffect):
    """Each buried face slides as one area at its centroid, pressed by (1 − sin φ) of the rim's mean
    stress.

    Source: at-rest pressure of Jaky (1944), J. Soc. Hungarian Architects and Engineers 78, 355-358;
    the area of a circle's segment and its centroid.
    """

    name, most = "sidewall_friction", 1.0

    def forces(self, scene: Scene) -> Scene:
        rest = 1.0 - np.sin(np.arctan(scene.ground.tan_phi))
        strength = scene.ground.cohesion + rest * scene.pressure * scene.ground.tan_phi
        return _rubbed(scene, self.strength * strength)


@dataclass(frozen=True)
class AdheringSidewall(PlantEffect):
    """The same faces under adhesion c and the passive pressure of the soil beside them alone.

    Source: adhesion and overburden on a buried face, after Osman (1964), J. Agric. Eng. Res. 9.
    """

    name, most = "sidewall_friction", 2.0

    def forces(self, scene: Scene) -> Scene:
        over = 0.5 * WEIGHT * np.maximum(scene.sinkage, 0.0) * passive(scene.ground.tan_phi)
        strength = scene.ground.cohesion + over * scene.ground.tan_phi
        return _rubbed(scene, self.strength * strength)


def _rubbed(scene: Scene, strength: Array) -> Scene:
    """Both faces slide as one area at its centroid under this shear stress [Pa]."""
    radius, angle = scene.rig.radius, scene.theta_1
    area = 0.5 * radius**2 * (angle - 0.5 * np.sin(2.0 * angle))  # the leading half of the segment
    below = 2.0 * radius**3 * np.sin(angle) ** 3 / np.maximum(6.0 * area, 1e-12)
    ahead = 0.4 * radius * np.sin(angle)
    force = 2.0 * strength * area * scene.direction * scene.moving
    back, up = below - radius * scene.ratio, ahead  # sliding velocity of the centroid over ω
    size = np.hypot(back, up) + 1e-9
    torque = force * (below * back + ahead * up) / size
    return replace(scene, torque=scene.torque + torque, pull=scene.pull + force * back / size)


@dataclass(frozen=True)
class OffsetAxle(PlantEffect):
    """The axle sits e beside the middle of a round wheel: R = e cos ψ' + √(r² − e² sin² ψ'); W
    lifts with it.
    """

    phase: float = 0.0

    name, most = "wheel_eccentricity", 0.003

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.0, 2.0 * np.pi)))

    def radius(self, radius: Array, motion: TrueMotion) -> Array:
        """Radius below the axle (n,) [m], of a round wheel's (n,) [m]."""
        return self.below(radius, motion.turn)

    def forces(self, scene: Scene) -> Scene:
        psi, step = scene.motion.turn, 1e-4
        base = np.full(psi.size, scene.rig.radius)
        lever = (self.below(base, psi + step) - self.below(base, psi - step)) / (2.0 * step)
        lifted = self.below(base, psi) - scene.rig.radius
        touching = scene.carried > 1.0
        return replace(
            scene,
            torque=scene.torque + scene.carried * lever * scene.moving,
            sinkage=np.where(touching, scene.sinkage - lifted, scene.sinkage),
        )

    def below(self, radius: Array, turn: Array) -> Array:
        """Radius below the axle (n,) [m], at angles `turn` (n,) [rad]."""
        angle = turn + self.phase
        return np.asarray(
            self.strength * np.cos(angle)
            + np.sqrt(radius**2 - (self.strength * np.sin(angle)) ** 2)
        )


@dataclass(frozen=True)
class DentedRim(OffsetAxle):
    """One side of the rim is flat: R = r − e g, g a bell once a turn about ψ', as wide as its
    flank.
    """

    flank: float = 0.7  # [rad]

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.0, 2.0 * np.pi)), float(rng.uniform(0.6, 1.0)))

    def below(self, radius: Array, turn: Array) -> Array:
        """r − e g (n,) [m] of a round wheel's r (n,) [m], at angles `turn` (n,) [rad]."""
        narrow = 1.0 / self.flank**2
        return np.asarray(
            radius - self.strength * np.exp(narrow * (np.cos(turn + self.phase) - 1.0))
        )


@dataclass(frozen=True)
class Hub(PlantEffect, ABC):
    """The hub runs out: it lifts the axle and drops it again, and the rim stays round. Only the
    potentiometer sees it; its forms give the wave.
    """

    phase: float = 0.0

    name, most = "hub_runout", 0.003

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.0, 2.0 * np.pi)))

    @abstractmethod
    def wave(self, angle: Array) -> Array:
        """Lift of unit size at an angle (n,) [rad] of the wheel."""

    def sensed(self, felt: Felt) -> Felt:
        lifted = self.strength * self.wave(felt.scene.motion.turn + self.phase)
        return felt.read(sinkage=felt.sinkage - lifted * (felt.scene.carried > 1.0))


@dataclass(frozen=True)
class OvalHub(Hub):
    """cos ψ' and 0.4 of it twice a turn."""

    def wave(self, angle: Array) -> Array:
        """cos ψ' + 0.4 cos 2ψ' (n,), dimensionless, at angles ψ' (n,) [rad]."""
        return np.asarray(np.cos(angle) + 0.4 * np.cos(2.0 * angle))


@dataclass(frozen=True)
class KeyedHub(Hub):
    """A bell of 0.6 rad once a turn: a key that stands proud of its groove."""

    def wave(self, angle: Array) -> Array:
        """e^((cos ψ' − 1)/0.6²) (n,), dimensionless, at angles ψ' (n,) [rad]."""
        return np.asarray(np.exp((np.cos(angle) - 1.0) / 0.6**2))


@dataclass(frozen=True)
class ElasticInertia(PlantEffect):
    """Torque J dω/dt of a rotor behind an elastic shaft: it follows within a tenth of a second.

    Source: two masses and a damped spring; the rotor's acceleration is the wheel's through a
    low-pass.
    """

    lag: float = 0.05  # [s]

    name, most = "wheel_inertia", 1.5

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.03, 0.12)))

    def loss(self, scene: Scene) -> Array:
        """J times the acceleration that the rotor has (n,), at the axle [N·m]."""
        gain = -float(np.expm1(-scene.motion.step / self.lag))
        state, torques = 0.0, []
        for alpha in scene.motion.alpha.tolist():
            state += gain * (alpha - state)
            torques.append(self.strength * state)
        return np.array(torques)

    def coinciding(self) -> dict[str, float]:
        return {"inertia": self.strength}


@dataclass(frozen=True)
class GearedInertia(PlantEffect):
    """Torque J dω/dt over the gear's efficiency while it speeds up, times it while it slows down.

    Source: power through a gear that loses a share either way.
    """

    efficiency: float = 0.85

    name, most = "wheel_inertia", 1.5

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.75, 0.92)))

    def loss(self, scene: Scene) -> Array:
        """J α/η (n,) speeding up, J α η slowing down, at the axle [N·m]; α = dω/dt, η the
        efficiency.
        """
        alpha, omega = scene.motion.alpha, scene.motion.omega
        factor = np.where(alpha * omega > 0.0, 1.0 / self.efficiency, self.efficiency)
        return np.asarray(self.strength * alpha * factor)

    def coinciding(self) -> dict[str, float]:
        return {"inertia": self.strength}


@dataclass(frozen=True)
class WornRim(PlantEffect):
    """The wheel's radius is r (1 + e + e/10 cos 2ψ): worn, and not quite round; the configuration
    says r.
    """

    phase: float = 0.0

    name, signed, most = "wheel_radius_error", True, 0.06

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), float(rng.uniform(0.0, 2.0 * np.pi)))

    def radius(self, radius: Array, motion: TrueMotion) -> Array:
        """r (1 + e + e/10 cos 2ψ') (n,) [m] of radii r (n,) [m]."""
        shape = 1.0 + 0.1 * np.cos(2.0 * (motion.turn + self.phase))
        return radius * (1.0 + self.strength * shape)

    def coinciding(self) -> dict[str, float]:
        return {"error": self.strength}


@dataclass(frozen=True)
class YieldingRim(PlantEffect):
    """The rim yields under load, so it rolls on r (1 + e (3/4 + W/4W₀)).

    Source: effective rolling radius of an elastic wheel, Pacejka (2012), Tire and Vehicle
    Dynamics, ch. 1.
    """

    weight: float = 60.0  # W₀ [N]

    name, signed, most = "wheel_radius_error", True, 0.06

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most * cls.sign(rng), facts.weight)

    def radius(self, radius: Array, motion: TrueMotion) -> Array:
        """r (1 + e (3/4 + W/4W₀)) (n,) [m] of radii r (n,) [m]; W is the weight on the axle."""
        pressed = 0.75 + 0.25 * motion.weight / self.weight
        return radius * (1.0 + self.strength * pressed)


EFFECTS: tuple[type[PlantEffect], ...] = (
    WallBulldozing,
    BowWaveBulldozing,
    RestingSidewall,
    AdheringSidewall,
    OffsetAxle,
    DentedRim,
    OvalHub,
    KeyedHub,
    ElasticInertia,
    GearedInertia,
    WornRim,
    YieldingRim,
)
