"""What an effect is: one class in one file, whose fields are its parameters and whose methods are
where it acts.

A method left alone is the identity. A method that is written gives back its first argument
unchanged, to the last bit, when every strength has its off value, which is also its default. All of
them are pure and take floats as well as arrays (n,), so the simulator, the diagnosis and the
on-line filter share them.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from gritd.estimator.stages.situation import (
    Balanced,
    Complete,
    ContactLaw,
    Loaded,
    Motion,
    OnSoil,
    Powered,
    Reaction,
    Recall,
    Sensed,
    Situation,
)
from gritd.estimator.terramechanics.soil import Scalar, Soil, Wheel

Stage = Literal["soil", "contact", "wheel", "testbed", "drivetrain", "sensor", "any"]
STAGES: tuple[Stage, ...] = ("soil", "contact", "wheel", "testbed", "drivetrain", "sensor", "any")

EXPERIMENTS = {
    "standstill": "stand still for some seconds with the drive powered",
    "lifted_spin": "lift the wheel off the soil and spin it at several speeds, both ways",
    "reversal": "drive backward over the same ground at the same slip",
    "load_step": "repeat at a lighter and a heavier load",
    "slip_step": "step the slip at one load and speed",
    "speed_step": "step the speed at one load and slip",
    "second_pass": "drive the same rut again",
    "shifted_start": "start elsewhere on the bed",
    "long_run": "hold one condition until nothing warms up or dries any more",
    "penetration": "press a plate or the standing wheel into the soil and read force against depth",
    "dead_weight": "press the wheel on a rigid stop under known weights",
    "rough_rim": "glue sandpaper on the rim and repeat",
    "smooth_wheel": "repeat with a smooth wheel of the same radius",
    "level": "put a spirit level on the bed, or turn the testbed round",
    "tape": "measure radius, travel and surface with tape and gauge",
    "clamp_meter": "measure the motor current with a second instrument",
    "wrench": "read the axle torque with the force/torque sensor",
}


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    role:   a strength turns the effect off at `off`; a shape says where, how fast, or how often.
    centre: prior mean (a strength's is its off value); sigma: prior standard deviation, the size to
    be expected.
    scan:   the fit has many local optima along it, so walk a grid before descending.
    stated: the least that a configuration may state, where that is less than can be found: older
            recordings hold their configuration.
    """

    name: str
    meaning: str
    unit: str
    role: Literal["strength", "shape"]
    centre: float
    sigma: float
    low: float
    high: float
    scan: bool = False
    stated: float | None = None

    @property
    def off(self) -> float:
        return self.centre


def strength(
    meaning: str,
    unit: str,
    *,
    typical: float,
    low: float,
    high: float,
    off: float = 0.0,
    stated: float | None = None,
) -> Any:
    """A field whose off value switches the effect off; `typical` is the size to be expected where
    it is at work.
    """
    return _field(off, meaning, unit, "strength", typical, low, high, False, stated)


def shape(
    meaning: str,
    unit: str,
    *,
    mean: float,
    sigma: float,
    low: float,
    high: float,
    scan: bool = False,
) -> Any:
    """A field that shapes the effect and means nothing while it is off."""
    return _field(mean, meaning, unit, "shape", sigma, low, high, scan)


def _field(default: float, *rest: Any) -> Any:
    return field(default=default, metadata={"parameter": rest})


# covariates that a table of steady states does not have
COURSE = ("wheel_angle", "position", "time", "heat", "acceleration", "rate", "reversal")


class Fingerprint(NamedTuple):
    """Where the effect shows most."""

    channel: str  # torque, drawbar_pull, sinkage, load
    covariate: (
        str  # slip, speed, load, sinkage, wheel_angle, position, time, acceleration, run, constant,
    )
    #                 rate (of the channel itself), heat (∫I² since the run began),
    #                 reversal (angle turned since the drive last turned round)
    sentence: str


def told_apart(**by: str) -> Mapping[str, str]:
    """Other effects that look alike, each with the key of EXPERIMENTS that distinguishes them."""
    return by


@dataclass(frozen=True)
class Effect:
    """Base of all effects. The first line of a subclass's docstring is its plain sentence, the rest
    its formula.
    """

    name: ClassVar[str]  # the file's name
    stage: ClassVar[Stage]
    fingerprint: ClassVar[Fingerprint]
    # other effect -> key of EXPERIMENTS
    confusable_with: ClassVar[Mapping[str, str]] = told_apart()
    at_start: ClassVar[Recall] = (0.0,)  # what `remember` starts from
    # acts on the on-line filter alone; the forward model needs nothing of it
    filter_only: ClassVar[bool] = False
    # looks along time, so a campaign's runs go through the forward model one by one
    by_run: ClassVar[bool] = False
    # begins anew in every run: what a campaign shows of it, the next one does too
    every_run: ClassVar[bool] = False
    # the load stage needs a predicted sinkage: the balance is solved twice
    needs_sinkage: ClassVar[bool] = False
    # covariates over which no law says how a zero changes: there it may follow any smooth function
    free_along: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls) -> None:
        cls.name = cls.__module__.rpartition(".")[2]

    def geometry(self, wheel: Wheel) -> Wheel:
        """The wheel the soil feels, from the configured one."""
        return wheel

    def motion(self, motion: Motion, wheel: Wheel) -> Motion:
        """The true motion, from the measured one."""
        return motion

    def soil(self, soil: Soil, situation: Situation) -> Soil:
        """The soil here and now."""
        return soil

    def contact(self, law: ContactLaw, situation: OnSoil) -> ContactLaw:
        """How stress is spread and mobilised on the rim."""
        return law

    def load(self, load: Scalar, situation: OnSoil) -> Scalar:
        """The load on the soil (n,) [N], from the weights on the axle (n,) [N]."""
        return load

    def wheel(self, reaction: Reaction, situation: Balanced) -> Reaction:
        """Forces on the axle and its sinkage beyond what the rim stresses give."""
        return reaction

    def testbed(self, reaction: Reaction, situation: Balanced) -> Reaction:
        """What the rig's frame adds or takes before the sensors."""
        return reaction

    def torque_loss(self, situation: Loaded) -> Scalar:
        """Torque consumed between motor and axle (n,), seen from the axle [N·m], positive for
        forward rotation.
        """
        return 0.0

    def torque_factor(self, situation: Powered) -> Scalar:
        """True over configured torque constant (n,) [-]."""
        return 1.0

    def sensors(self, sensed: Sensed, situation: Loaded) -> Sensed:
        """What the channels read, from what is true."""
        return sensed

    def correct(self, sensed: Sensed, situation: Loaded) -> Sensed:
        """What is true, from what the channels read: the inverse of `sensors`."""
        return sensed

    def answered(self, slip: Scalar, load: Scalar, situation: Complete) -> tuple[Scalar, Scalar]:
        """On line: slip and load [N] that the rim's stresses answer to, from the present ones."""
        return slip, load

    def remember(self, memory: Recall, step: float, situation: Complete) -> Recall:
        """On line: the memory one `step` [s] later; others find it in situation.memory."""
        return memory

    @classmethod
    def bears_on_soil(cls) -> bool:
        """Whether it changes what the soil carries; all others act behind the vertical balance."""
        stages = ("geometry", "motion", "soil", "contact", "load")
        return any(getattr(cls, stage) is not getattr(Effect, stage) for stage in stages)

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        return tuple(_parameter(f.name, f.default, *f.metadata["parameter"]) for f in fields(cls))

    @classmethod
    def in_steady_states(cls) -> type[Effect] | None:
        """The effect as a table of steady states shows it; None where it needs time, place or
        angle.
        """
        return None if cls.fingerprint.covariate in COURSE else cls

    @classmethod
    def without_side_force(cls) -> type[Effect]:
        """The effect where no side force is compared."""
        return cls

    @classmethod
    def sentence(cls) -> str:
        """What the effect is, in plain words."""
        return inspect.cleandoc(cls.__doc__ or "").partition("\n\n")[0].replace("\n", " ")

    @classmethod
    def equation(cls) -> str:
        """What it changes, and how."""
        return cls.formula().partition("\n\n")[0]

    @classmethod
    def formula(cls) -> str:
        """The equation, what is to be known of it, and its source."""
        return inspect.cleandoc(cls.__doc__ or "").partition("\n\n")[2].strip()


def order_of(effect: type[Effect]) -> str | None:
    """The shape of an effect that is an order of the wheel angle, if it has one."""
    return next(
        (p.name for p in effect.parameters() if p.role == "shape" and p.scan and not p.unit), None
    )


def _parameter(
    name: str,
    centre: Any,
    meaning: str,
    unit: str,
    role: Literal["strength", "shape"],
    sigma: float,
    low: float,
    high: float,
    scan: bool = False,
    stated: float | None = None,
) -> Parameter:
    return Parameter(name, meaning, unit, role, float(centre), sigma, low, high, scan, stated)


RATE_REFERENCE = 0.02  # [m/s] speed at which the soil's parameters were found
# [m/s] slower than this speed no longer matters, so a standing wheel stays finite
RATE_FLOOR = 0.001
TURNING = 0.01  # [rad/s] width over which a friction torque changes sign


def turning(wheel_speed: Scalar) -> Scalar:
    """Sign of the rotation (n,), −1 … 1, smooth over ±TURNING: a standing wheel has none.

    tanh instead of a jump: Armstrong-Hélouvry, Dupont, Canudas de Wit (1994), Automatica 30,
    1083-1138, section 3.
    """
    return np.tanh(wheel_speed / TURNING)
