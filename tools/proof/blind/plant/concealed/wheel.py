"""Effects of the wheel's body: what its front, faces, lugs, shape and mass add to the rim of Eqs.
(8)-(10).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.effect import Effect, Facts
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt, Motion, Scene

WEIGHT = 15e3  # unit weight of the soil γ [N/m³]


def passive(tan_phi: Array | float) -> Array:
    """Coefficient of passive earth pressure K_p = (1 + sin φ)/(1 − sin φ) (Rankine)."""
    sine = np.sin(np.arctan(tan_phi))
    return np.asarray((1.0 + sine) / (1.0 - sine))


@dataclass(frozen=True)
class Bulldozing(Effect):
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
class Grousers(Effect):
    """N separate lugs of height h, each a blade that pushes with passive pressure while it is in
    the soil.

    A lug at θ, root at depth d, carries F = m b [½ γ ((d + h)² − d²) K_p + 2 c h √K_p + K_p σ̄ h],
    m the share 1 − e^(−j/k) that it has mobilised; T + F (r + h/2), DP + F cos θ, and F sin θ lifts
    the wheel (read as sinkage).
    Source: blade theory of Terzaghi (1943) with the surcharge σ̄ of the rim; lugs one by one as in
    Skonieczny, Moreland, Wettergreen (2012), IEEE/RSJ IROS.
    """

    count: int = 16
    phase: float = 0.0

    name, most = "grousers", 0.008

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, int(rng.integers(10, 28)), float(rng.uniform(0.0, 2.0 * np.pi)))

    def forces(self, scene: Scene) -> Scene:
        torque, pull, lift = np.zeros((3, scene.torque.size))
        for lug in range(self.count):
            push, theta = self._lug(scene, lug)
            torque += push * (scene.rig.radius + 0.5 * self.strength)
            pull += push * np.cos(theta)
            lift += push * np.sin(theta)
        sign = scene.direction * scene.moving
        # dW/dz of a wheel
        stiffness = 2.0 * np.maximum(scene.carried, 1.0) / np.maximum(scene.sinkage, 1e-3)
        raised = np.where(scene.sinkage > 0.0, lift / stiffness, 0.0)
        return replace(
            scene,
            torque=scene.torque + torque * sign,
            pull=scene.pull + pull * sign,
            sinkage=scene.sinkage - raised,
        )

    def _lug(self, scene: Scene, lug: int) -> tuple[Array, Array]:
        """Push of one lug [N] and its angle θ [rad], counted towards the entry."""
        turned = scene.motion.turn * scene.direction + self.phase + 2.0 * np.pi * lug / self.count
        theta = np.mod(-turned + np.pi, 2.0 * np.pi) - np.pi
        radius, height = scene.rig.radius, self.strength
        root = np.maximum(radius * (np.cos(theta) - np.cos(scene.theta_1)), 0.0)
        entered = np.clip((scene.theta_1 - theta) / 0.1, 0.0, 1.0) * np.clip(
            (theta + 0.3) / 0.3, 0.0, 1.0
        )
        coefficient = passive(scene.ground.tan_phi)
        pressure = 0.5 * WEIGHT * ((root + height) ** 2 - root**2) * coefficient
        pressure = pressure + 2.0 * scene.ground.cohesion * height * np.sqrt(coefficient)
        pressure = pressure + coefficient * scene.pressure * height
        swept = np.maximum(scene.theta_1 - theta, 0.0)
        jay = radius * (swept - scene.ratio * (np.sin(scene.theta_1) - np.sin(theta)))
        mobilised = 1.0 - np.exp(-np.maximum(jay, 0.0) / scene.ground.shear_modulus)
        return scene.rig.width * pressure * mobilised * entered, theta


@dataclass(frozen=True)
class SidewallFriction(Effect):
    """Each buried face slides as one area at its centroid, pressed by (1 − sin φ) of the rim's mean
    stress.

    Source: at-rest pressure of Jaky (1944), J. Soc. Hungarian Architects and Engineers 78, 355-358;
    the area of a circle's segment and its centroid.
    """

    name, most = "sidewall_friction", 1.0

    def forces(self, scene: Scene) -> Scene:
        radius, angle = scene.rig.radius, scene.theta_1
        # the leading half of the segment
        area = 0.5 * radius**2 * (angle - 0.5 * np.sin(2.0 * angle))
        below = (
            radius
            * 2.0
            * np.sin(angle) ** 3
            / np.maximum(3.0 * (angle - 0.5 * np.sin(2.0 * angle)), 1e-12)
        )
        ahead = 0.4 * radius * np.sin(angle)
        rest = 1.0 - np.sin(np.arctan(scene.ground.tan_phi))
        strength = scene.ground.cohesion + rest * scene.pressure * scene.ground.tan_phi
        force = 2.0 * self.strength * strength * area * scene.direction * scene.moving
        back, up = below - radius * scene.ratio, ahead  # sliding velocity of the centroid over ω
        size = np.hypot(back, up) + 1e-9
        torque = force * (below * back + ahead * up) / size
        return replace(scene, torque=scene.torque + torque, pull=scene.pull + force * back / size)


@dataclass(frozen=True)
class WheelEccentricity(Effect):
    """The axle sits e beside the middle of a round wheel: R = e cos ψ' + √(r² − e² sin² ψ'); W
    lifts with it.
    """

    phase: float = 0.0

    name, most = "wheel_eccentricity", 0.003

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, float(rng.uniform(0.0, 2.0 * np.pi)))

    def radius(self, radius: Array, motion: Motion) -> Array:
        return self._below(radius, motion.turn)

    def forces(self, scene: Scene) -> Scene:
        psi, step = scene.motion.turn, 1e-4
        base = np.full(psi.size, scene.rig.radius)
        lever = (self._below(base, psi + step) - self._below(base, psi - step)) / (2.0 * step)
        touching = scene.carried > 1.0
        sinkage = np.where(
            touching, scene.sinkage - (scene.radius - scene.rig.radius), scene.sinkage
        )
        return replace(
            scene, torque=scene.torque + scene.carried * lever * scene.moving, sinkage=sinkage
        )

    def _below(self, radius: Array, turn: Array) -> Array:
        angle = turn + self.phase
        return np.asarray(
            self.strength * np.cos(angle)
            + np.sqrt(radius**2 - (self.strength * np.sin(angle)) ** 2)
        )


@dataclass(frozen=True)
class WheelInertia(Effect):
    """Torque J dω/dt for wheel and geared rotor. Newton's second law."""

    name, most = "wheel_inertia", 1.5

    def loss(self, scene: Scene) -> Array:
        return np.asarray(self.strength * scene.motion.alpha)

    def coinciding(self) -> dict[str, float]:
        return {"inertia": self.strength}


@dataclass(frozen=True)
class WheelRadiusError(Effect):
    """The wheel's radius is r (1 + e); the configuration says r."""

    name, signed, most = "wheel_radius_error", True, 0.06

    def radius(self, radius: Array, motion: Motion) -> Array:
        return radius * (1.0 + self.strength)

    def sensed(self, felt: Felt) -> Felt:
        return felt

    def coinciding(self) -> dict[str, float]:
        return {"error": self.strength}


EFFECTS: tuple[type[Effect], ...] = (
    Bulldozing,
    Grousers,
    SidewallFriction,
    WheelEccentricity,
    WheelInertia,
    WheelRadiusError,
)
