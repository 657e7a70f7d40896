"""Lugs on the rim."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from gritd.tools.proof.blind.plant.concealed.pressure import WEIGHT, passive
from gritd.tools.proof.blind.plant.effect import Facts, PlantEffect
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Scene


@dataclass(frozen=True)
class Lugs(PlantEffect, ABC):
    """N lugs of height h; their forms give the force of each."""

    count: int = 16
    phase: float = 0.0

    name, most = "grousers", 0.008

    @classmethod
    def drawn(cls, rng: np.random.Generator, facts: Facts) -> Self:
        return cls(cls.most, int(rng.integers(10, 28)), float(rng.uniform(0.0, 2.0 * np.pi)))

    def angle(self, scene: Scene, lug: int) -> Array:
        """Where a lug stands, θ (n,) [rad], counted towards the entry."""
        turned = scene.motion.turn * scene.direction + self.phase + 2.0 * np.pi * lug / self.count
        return np.asarray(np.mod(-turned + np.pi, 2.0 * np.pi) - np.pi)

    @abstractmethod
    def push(self, scene: Scene, theta: Array) -> Array:
        """Force (n,) of a lug at θ (n,), along the rim [N]."""

    def depth(self, scene: Scene) -> Array | float:
        """By how much the wheel rides deeper for its lugs (n,) [m]."""
        return 0.0

    def forces(self, scene: Scene) -> Scene:
        torque, pull, lift = np.zeros((3, scene.torque.size))
        for lug in range(self.count):
            theta = self.angle(scene, lug)
            push = self.push(scene, theta)
            torque += push * (scene.rig.radius + 0.5 * self.strength)
            pull += push * np.cos(theta)
            lift += push * np.sin(theta)

        sign = scene.direction * scene.moving
        # dW/dz of a wheel
        stiffness = 2.0 * np.maximum(scene.carried, 1.0) / np.maximum(scene.sinkage, 1e-3)
        raised = np.where(scene.sinkage > 0.0, lift / stiffness - self.depth(scene), 0.0)

        return replace(
            scene,
            torque=scene.torque + torque * sign,
            pull=scene.pull + pull * sign,
            sinkage=scene.sinkage - raised,
        )


@dataclass(frozen=True)
class Blades(Lugs):
    """Each lug is a blade that pushes with passive pressure while it is in the soil.

    A lug at θ, root at depth d, carries F = m b [½ γ ((d + h)² − d²) K_p + 2 c h √K_p + K_p σ̄ h],
    m the share 1 − e^(−j/k) that it has mobilised; T + F (r + h/2), DP + F cos θ, and F sin θ lifts
    the wheel (read as sinkage).
    Source: blade theory of Terzaghi (1943) with the surcharge σ̄ of the rim; lugs one by one as in
    Skonieczny, Moreland, Wettergreen (2012), IEEE/RSJ IROS.
    """

    def push(self, scene: Scene, theta: Array) -> Array:
        """Force F (n,) along the rim [N] of a blade at θ (n,) [rad]. It comes in over 0.1 rad past
        the entry and fades out over 0.3 rad behind the axle.
        """
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
        return np.asarray(scene.rig.width * pressure * mobilised * entered)


@dataclass(frozen=True)
class Teeth(Lugs):
    """Each lug cuts a slot as it passes under the axle, F = b h (4 c + σ̄ tan φ) g(θ), g a bell
    about θ₁/2, and carries soil away: the wheel rides h i/(1 − i)/4 deeper.

    Source: sharing of the rim's load between soil on lugs and soil on rim, Wong (2008), Theory of
    Ground Vehicles, 4th ed.; force that swells once a lug as in Irani, Bauer, Warkentin (2011),
    J. Terramechanics 48, 307-321.
    """

    def push(self, scene: Scene, theta: Array) -> Array:
        """Force F (n,) along the rim [N] of a tooth at θ (n,) [rad]. Below a slip of a quarter it
        falls to 0 with the slip.
        """
        ground, middle = scene.ground, 0.5 * scene.theta_1
        spread = np.maximum(0.35 * scene.theta_1, 0.03)
        strength = 4.0 * ground.cohesion + scene.pressure * ground.tan_phi
        bell = np.exp(-(((theta - middle) / spread) ** 2))
        slipping = np.clip(4.0 * np.abs(scene.slip), 0.0, 1.0)
        return np.asarray(scene.rig.width * self.strength * strength * bell * slipping)

    def depth(self, scene: Scene) -> Array | float:
        """h i/(1 − i)/4 (n,) [m], i from 0 to 0.8; none at rest."""
        slip = np.clip(scene.slip, 0.0, 0.8)
        return 0.25 * self.strength * slip / (1.0 - slip) * scene.moving


EFFECTS: tuple[type[PlantEffect], ...] = (Blades, Teeth)
