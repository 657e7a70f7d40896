"""What the plant's physics may know: the rig, the motion of one run, and the state of the wheel in
it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gritd.tools.proof.blind.plant.contact import PlantSoil, Rim
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.servo import Servo

# [m/s] below about this rim and carriage creep: soil forces fade out, shear has no distance to
# build up
REST = 1.5e-3
HANGING = -5e-3  # [m] sinkage of a lifted wheel


@dataclass(frozen=True)
class TrueRig:
    """The rig as it is, not as configured."""

    radius: float  # r [m]
    width: float  # b [m]
    torque_constant: float  # at the axle [N·m/A]
    wheel: Servo
    carriage: Servo
    lag: float  # [s] of the vertical axis


@dataclass(frozen=True)
class TrueMotion:
    """True motion of one run, arrays (n,) at a fixed step."""

    time: Array  # [s] since the campaign began
    turn: Array  # wheel angle [rad]
    omega: Array  # [rad/s]
    travel: Array  # carriage position on the bed [m]
    speed: Array  # v [m/s]
    weight: Array  # on the axle [N]
    passes: int  # 1 on fresh soil

    @property
    def step(self) -> float:
        return float(self.time[1] - self.time[0])

    @property
    def alpha(self) -> Array:
        """Angular acceleration (n,) [rad/s²]."""
        return np.gradient(self.omega, self.step)


@dataclass(frozen=True)
class Scene:
    """One run as the effects see it; fields after `motion` fill up along the chain. Arrays (n,)."""

    rig: TrueRig
    motion: TrueMotion
    radius: Array  # below the axle, sample by sample [m]
    direction: Array  # ±1
    moving: Array  # 0 at rest, 1 in motion
    ratio: Array  # v/(rω)
    ground: PlantSoil
    rim: Rim = field(default_factory=Rim)
    theta_1: Array = field(default_factory=lambda: np.zeros(0))
    sinkage: Array = field(default_factory=lambda: np.zeros(0))
    pressure: Array = field(default_factory=lambda: np.zeros(0))
    carried: Array = field(default_factory=lambda: np.zeros(0))  # W [N]
    torque: Array = field(default_factory=lambda: np.zeros(0))  # at the axle [N·m]
    pull: Array = field(default_factory=lambda: np.zeros(0))  # DP [N]
    side: Array = field(default_factory=lambda: np.zeros(0))  # sideways force [N]

    @property
    def slip(self) -> Array:
        """(n,): 1 − v/(rω) when driving, rω/v − 1 when braking."""
        return np.where(
            self.ratio <= 1.0, 1.0 - self.ratio, 1.0 / np.maximum(self.ratio, 1.0) - 1.0
        )

    @property
    def rim_speed(self) -> Array:
        """rω (n,) [m/s]."""
        return np.asarray(self.radius * self.motion.omega)


def scene_of(
    rig: TrueRig, ground: PlantSoil, motion: TrueMotion, radius: Array | None = None
) -> Scene:
    """Kinematics of one run; radius (n,) below the axle [m], if it varies."""
    radius = np.full(motion.time.size, rig.radius) if radius is None else radius
    rim = radius * motion.omega
    fastest = np.maximum(np.abs(rim), np.abs(motion.speed))
    moving = 1.0 - np.exp(-((fastest / REST) ** 2))
    safe = np.where(np.abs(rim) > 1e-6, rim, np.where(rim < 0, -1e-6, 1e-6))
    ratio = 1.0 + moving * (np.clip(motion.speed / safe, 0.0, 20.0) - 1.0)
    return Scene(
        rig, motion, radius, np.where(rim + motion.speed < 0.0, -1.0, 1.0), moving, ratio, ground
    )


@dataclass(frozen=True)
class Felt:
    """What happens, and what an ideal sensor in each channel reads; arrays (n,)."""

    scene: Scene
    motor_torque: Array  # at the axle [N·m], with the drivetrain's losses
    sinkage: Array  # read [m]
    current: Array  # read [A]
    pull: Array  # read [N]
    load: Array  # read [N]
    torque: Array  # the force/torque sensor's [N·m]
    carriage: Array  # carriage position as its encoder tells it [m]
    side: Array  # read [N]

    def read(self, **changed: Any) -> Felt:
        return replace(self, **changed)
