"""What the stages of the forward model pass on: the motion, the situation of the wheel, and what is
felt and read.

Every field is a float (one instant, as the loop has it) or an array (n,) of one run in order of
time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from gritd.estimator.stages.history import rate_of
from gritd.estimator.terramechanics.original import Mobilisation, janosi
from gritd.estimator.terramechanics.soil import Scalar, Wheel

S = TypeVar("S", bound="Situation")
Recall = tuple[float, ...]  # what one effect remembers

HIGHEST_SLIP = 0.95  # beyond it the wheel digs on without coming to a steady depth
CREEP = 2e-4  # [m/s] slower than this the wheel neither drives nor brakes: soil forces fade out


@dataclass(frozen=True)
class Motion:
    """The motion as the encoders tell it, the weights on the axle, and where and when the run takes
    place.
    """

    time: Scalar  # [s] since the first run of the campaign began
    wheel_angle: Scalar  # [rad]
    wheel_speed: Scalar  # ω [rad/s]
    carriage_position: Scalar  # [m] since the run began
    carriage_speed: Scalar  # v [m/s]
    load: Scalar  # weights on the axle [N]
    pass_number: Scalar = 1.0  # 1 on fresh soil
    start_position: Scalar = 0.0  # [m] on the bed, where the run begins
    temperature: Scalar | None = None  # of the motor housing [°C], where measured
    # dω/dt [rad/s²]; differentiated from wheel_speed where absent
    wheel_acceleration: Scalar | None = None
    # measured [m]; only its direction is used, predicted where absent
    sinkage: Scalar | None = None
    run: Scalar = 0.0  # number of the run, where several stand one after another


@dataclass(frozen=True, kw_only=True)
class Situation(Motion):
    """A wheel of true radius in true motion: what the soil's effects may know. Each stage adds what
    it computes, in a type of its own; an attribute that is not there yet raises AttributeError.
    """

    wheel_acceleration: Scalar  # dω/dt [rad/s²]
    position: Scalar  # on the bed [m]
    travel: Scalar  # away from where the run began [m]
    radius: Scalar  # r [m]
    width: float  # b [m]
    slip: Scalar  # i [-], positive when driving, in the direction of travel
    direction: Scalar  # +1 forward, −1 backward, 0 at rest; smooth in between
    # on line
    sinking: Scalar = 0.0  # dz/dt [m/s]
    memory: Mapping[str, Recall] = field(default_factory=dict)  # of the effects, by their names


@dataclass(frozen=True, kw_only=True)
class OnSoil(Situation):
    """With the soil under the wheel: for contact and load."""

    cohesion: Scalar  # c [Pa]
    tan_phi: Scalar
    shear_modulus: Scalar  # k [m]


@dataclass(frozen=True, kw_only=True)
class Loaded(OnSoil):
    """With the vertical force of the soil: for sensors, and what the drive loses."""

    sinkage: Scalar  # z [m], positive down
    carried: Scalar  # W [N]


@dataclass(frozen=True, kw_only=True)
class Balanced(Loaded):
    """With the forces of the vertical balance: for wheel and testbed."""

    theta_1: Scalar  # [rad]
    torque: Scalar  # at the axle [N·m]
    drawbar_pull: Scalar  # DP [N]
    side_force: Scalar = 0.0  # of the soil, across the wheel [N]


@dataclass(frozen=True, kw_only=True)
class Powered(Loaded):
    """With the motor's current: for its torque constant. On line it is known before the torque."""

    current: Scalar  # [A]


@dataclass(frozen=True, kw_only=True)
class Complete(Balanced, Powered):
    """With all of it."""


def advanced(stage: type[S], situation: Motion, **values: Any) -> S:
    """The situation at a later stage, with what that has computed."""
    return stage(**{**vars(situation), **values})


@dataclass(frozen=True)
class ContactLaw:
    """How stress is spread over the rim and how much of the shear strength is mobilised."""

    theta_m_ratio: Scalar  # θₘ/θ₁ [-], Eq. (5)
    theta_2_ratio: Scalar = 0.0  # −θ₂/θ₁ [-]
    strength: Scalar = 1.0  # factor on c and tan φ [-]
    adhesion: Scalar = 1.0  # factor on c alone [-]
    friction: Scalar = 1.0  # factor on tan φ alone [-]
    side_slip: Scalar = 0.0  # tangent of the angle between wheel and travel [-]
    by_sliding: float = 0.0  # share in which shear stress has the direction of the sliding
    across: float = 1.0  # shear modulus along the wheel over that across it [-]
    mobilisation: Mobilisation = janosi  # share of the strength mobilised at j/k


@dataclass(frozen=True)
class Reaction:
    """What the axle feels and how deep it rides; forward and downward positive."""

    drawbar_pull: Scalar  # [N]
    load: Scalar  # [N]
    torque: Scalar  # [N·m]
    sinkage: Scalar  # [m]
    side_force: Scalar = 0.0  # [N]


@dataclass(frozen=True)
class Sensed:
    """What the channels read, in SI. `torque` is the force/torque sensor's, about the axle."""

    sinkage: Scalar  # [m]
    current: Scalar  # [A]
    drawbar_pull: Scalar  # [N]
    load: Scalar  # [N]
    torque: Scalar  # [N·m]
    side_force: Scalar = 0.0  # [N]


def situation_of(motion: Motion, wheel: Wheel) -> Situation:
    """Slip, direction and place of a wheel of true radius in true motion."""
    slip, direction = signed_slip(wheel.radius * motion.wheel_speed, motion.carriage_speed)
    acceleration = motion.wheel_acceleration
    if acceleration is None:
        acceleration = rate_of(motion.time, motion.wheel_speed)

    return advanced(
        Situation,
        motion,
        wheel_acceleration=acceleration,
        position=motion.start_position + motion.carriage_position,
        travel=np.abs(motion.carriage_position),
        radius=wheel.radius,
        width=wheel.width,
        slip=slip,
        direction=direction,
    )


def signed_slip(rim_speed: Scalar, carriage_speed: Scalar) -> tuple[Scalar, Scalar]:
    """Slip i and direction of travel, each (n,), from rω and v [m/s].

    Along the direction of travel i = (rω − v)/rω when driving and (rω − v)/v when braking, so the
    faster of the two divides. Opposed motions saturate at ±1; at rest both results go to 0
    smoothly.
    """
    direction = np.tanh((rim_speed + carriage_speed) / (2.0 * CREEP))
    fastest = np.maximum(np.maximum(np.abs(rim_speed), np.abs(carriage_speed)), CREEP)
    return np.clip(direction * (rim_speed - carriage_speed) / fastest, -1.0, 1.0), direction


def dug_by_slip(slip: Scalar) -> Scalar:
    """i/(1 − i): travel of the rim that does not drive, over the travel; a wheel that hardly moves
    digs in for long, and a wheel that skids does not dig.
    """
    driving = np.clip(slip, 0.0, HIGHEST_SLIP)
    return driving / (1.0 - driving)
