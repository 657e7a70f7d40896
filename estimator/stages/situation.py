"""What the stages of the forward model pass on: the motion, the situation of the wheel, and what is
felt and read.

Every field is a float (one instant, as the loop has it) or an array (n,) of one run in order of
time.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from gritd.estimator.stages.history import rate_of
from gritd.estimator.terramechanics.original import Mobilisation, janosi
from gritd.estimator.terramechanics.soil import Scalar, Wheel

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


@dataclass(frozen=True)
class Situation:
    """What an effect may know of the wheel. Below a comment, fields hold 0 until that stage."""

    time: Scalar  # [s]
    wheel_angle: Scalar  # [rad]
    wheel_speed: Scalar  # ω [rad/s]
    wheel_acceleration: Scalar  # dω/dt [rad/s²]
    carriage_speed: Scalar  # v [m/s]
    position: Scalar  # on the bed [m]
    pass_number: Scalar
    radius: Scalar  # r [m]
    width: float  # b [m]
    slip: Scalar  # i [-], positive when driving, in the direction of travel
    direction: Scalar  # +1 forward, −1 backward, 0 at rest; smooth in between
    load: Scalar  # weights on the axle [N]
    temperature: Scalar | None = None  # [°C]
    travel: Scalar = 0.0  # away from where the run began [m]
    run: Scalar = 0.0  # number of the run, where several stand one after another
    # the soil stage
    cohesion: Scalar = 0.0  # c [Pa]
    tan_phi: Scalar = 0.0
    shear_modulus: Scalar = 0.0  # k [m]
    # the vertical balance
    theta_1: Scalar = 0.0  # [rad]
    sinkage: Scalar = 0.0  # z [m], positive down
    sinking: Scalar = 0.0  # dz/dt [m/s], on line only
    carried: Scalar = 0.0  # vertical force of the soil W [N]
    torque: Scalar = 0.0  # at the axle [N·m]
    drawbar_pull: Scalar = 0.0  # DP [N]
    side_force: Scalar = 0.0  # of the soil, across the wheel [N]
    # the drivetrain
    current: Scalar = 0.0  # [A]
    # on line: what an effect remembers, by its name
    memory: Mapping[str, Recall] = field(default_factory=dict)


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

    return Situation(
        time=motion.time,
        wheel_angle=motion.wheel_angle,
        wheel_speed=motion.wheel_speed,
        wheel_acceleration=acceleration,
        carriage_speed=motion.carriage_speed,
        position=motion.start_position + motion.carriage_position,
        pass_number=motion.pass_number,
        radius=wheel.radius,
        width=wheel.width,
        slip=slip,
        direction=direction,
        load=motion.load,
        temperature=motion.temperature,
        travel=np.abs(motion.carriage_position),
        run=motion.run,
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
