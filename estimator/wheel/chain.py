"""The configured effects as the on-line filter uses them: one window at a time, in floats.

Sensor and drivetrain effects are undone before the update, wheel and testbed effects are added to
what is predicted, soil effects turn the estimated soil into the soil under this window, and contact
effects act through the shift of the eight integrals (shift.py). Everything an effect does stands in
its own file; here it is only put in order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from typing import NamedTuple

from gritd.estimator.config.effects import configured
from gritd.estimator.config.settings import ConfiguredEffect, Settings
from gritd.estimator.effects import in_order, make
from gritd.estimator.effects.base import Effect
from gritd.estimator.model.forward import axle_torque, corrected, paper_contact, prepare, react
from gritd.estimator.stages.situation import (
    Complete,
    Loaded,
    Motion,
    OnSoil,
    Powered,
    Recall,
    Sensed,
    Situation,
    advanced,
)
from gritd.estimator.terramechanics.soil import Scalar, Soil, Wheel
from gritd.estimator.wheel.form import NAME as FORM
from gritd.estimator.wheel.form import FormOnLine
from gritd.estimator.wheel.geometry import entry_angle
from gritd.estimator.wheel.sync import Snapshot

LAGGED = 0.5  # share of a correction for what lags that may be wrong
SOIL_STEP = 1e-4  # relative change by which the soil effects' slope is found


class Context(NamedTuple):
    """What the tracker knows besides the snapshot."""

    time: float  # [s] since the run began
    c: float  # present estimate [Pa]
    tan_phi: float
    k: float  # [m]
    acceleration: float = 0.0  # dω/dt [rad/s²]
    sinking: float = 0.0  # dz/dt [m/s]
    memory: Mapping[str, Recall] = {}  # what effects remember, by name
    origin: float = 0.0  # where the carriage stood when the run began, by its encoder [m]


class Here(NamedTuple):
    """The soil under this window from the estimated one: slope and offset of c [Pa], tan φ and k
    [m].
    """

    c_slope: float = 1.0
    c_offset: float = 0.0
    tan_phi_slope: float = 1.0
    tan_phi_offset: float = 0.0
    k_slope: float = 1.0
    k_offset: float = 0.0


class Added(NamedTuple):
    """What wheel and testbed effects add to rim torque [N·m] and pull [N], linear in c [Pa], tan φ
    and k [m].
    """

    torque: float = 0.0
    torque_by_c: float = 0.0
    torque_by_tan_phi: float = 0.0
    torque_by_k: float = 0.0
    pull: float = 0.0
    pull_by_c: float = 0.0
    pull_by_tan_phi: float = 0.0
    pull_by_k: float = 0.0


class Undone(NamedTuple):
    """What a window measures once the effects are accounted for, SI."""

    situation: Complete  # with the torque at the axle, drivetrain undone
    travel_speed: float  # [m/s]
    travel_doubt: float  # standard deviation by what effects make of it
    sinkage: float  # of the rim in the soil [m]
    load: float  # carried by the rim [N]
    load_doubt: float  # standard deviation by what effects make of it
    here: Here


class Chain:
    """The effects of a configuration at given values, ready for one window after another."""

    def __init__(self, settings: Settings, effects: tuple[Effect, ...]) -> None:
        self.effects = in_order(effects)
        self.acting = tuple(e for e in self.effects if not e.filter_only)
        self.wheel: Wheel = reduce(lambda wheel, e: e.geometry(wheel), self.effects, settings.wheel)
        self.reacts = any(_reacts(e) for e in self.acting)
        learnt = settings.discrepancy
        self.form = None if learnt is None else FormOnLine(learnt, self.wheel.radius)
        self._settings = settings
        soil = settings.soil
        self._exponent = soil.exponent.value
        self._modulus = soil.pressure_sinkage.modulus(settings.wheel.width)

    def undo(self, snapshot: Snapshot, load: float, context: Context) -> Undone:
        """Undo the sensor and drivetrain effects of a window and work out the others; load: W
        measured or assumed.
        """
        as_read = self._situation(snapshot, load, context)
        read = Sensed(
            snapshot.sinkage.value,
            snapshot.current.value,
            snapshot.drawbar_pull.value,
            load,
            snapshot.axle_torque.value,
        )

        true = corrected(read, as_read, self.effects)
        carried = self._carried(float(true.load), as_read)
        powered = advanced(
            Powered, as_read, current=true.current, carried=carried, sinkage=true.sinkage
        )
        situation = advanced(
            Complete,
            powered,
            torque=self._torque(true, powered),
            drawbar_pull=true.drawbar_pull,
            theta_1=entry_angle(self.wheel.radius, float(true.sinkage)).value,
        )

        felt = react(situation, self.effects)
        present = float(carried - (felt.load - carried))
        slip, load = self._answered(situation, present)

        return Undone(
            situation=situation,
            travel_speed=(travel := _travel_speed(situation, slip)),
            travel_doubt=LAGGED * abs(travel - float(situation.carriage_speed)),
            sinkage=float(true.sinkage - (felt.sinkage - situation.sinkage)),
            load=load,
            load_doubt=LAGGED * abs(load - present),
            here=self._here(situation, context),
        )

    def felt(
        self, situation: Complete, torque: float, pull: float, soil: tuple[float, float, float]
    ) -> tuple[float, float]:
        """Axle torque [N·m] and drawbar pull [N] where the rim gives `torque` and `pull` in a soil
        (c, tan φ, k).
        """
        c, tan_phi, k = soil
        situation = replace(
            situation,
            torque=torque,
            drawbar_pull=pull,
            cohesion=c,
            tan_phi=tan_phi,
            shear_modulus=k,
        )

        reaction = react(situation, self.effects)
        return float(reaction.torque), float(reaction.drawbar_pull)

    def _carried(self, load: float, situation: Loaded) -> float:
        """W on the soil: as measured, or what the effects leave of the weights."""
        if self._settings.wrench is not None:
            return load
        carried: Scalar = load
        for effect in self.effects:
            carried = effect.load(carried, situation)
        return float(carried)

    def _answered(self, situation: Complete, load: Scalar) -> tuple[float, float]:
        """Slip and load [N] that the stresses on the rim answer to."""
        slip: Scalar = situation.slip
        for effect in self.effects:
            slip, load = effect.answered(slip, load, situation)
        return float(slip), float(load)

    def _torque(self, true: Sensed, situation: Powered) -> float:
        if self._settings.drive.torque_source != "motor_shunt":
            return float(true.torque)
        return float(
            axle_torque(situation, self.effects, self._settings.drive.torque_constant.value)
        )

    def _situation(self, snapshot: Snapshot, load: float, context: Context) -> Loaded:
        motion = Motion(
            time=context.time,
            wheel_angle=snapshot.wheel_angle,
            wheel_speed=snapshot.wheel_speed.value,
            carriage_position=snapshot.carriage_position - context.origin,
            carriage_speed=snapshot.carriage_speed.value,
            load=load,
            pass_number=float(self._settings.place.pass_number),
            start_position=self._settings.place.start_position,
            temperature=snapshot.temperature,
            wheel_acceleration=context.acceleration,
            sinkage=snapshot.sinkage.value,
        )
        _, situation = prepare(self._settings.wheel, motion, self.effects)
        return advanced(
            Loaded,
            situation,
            memory=context.memory,
            sinking=context.sinking,
            cohesion=context.c,
            tan_phi=context.tan_phi,
            shear_modulus=context.k,
            carried=load,
        )

    def _here(self, situation: OnSoil, context: Context) -> Here:
        """Slope and offset of each soil parameter through the soil and contact effects."""
        law = reduce(
            lambda law, e: e.contact(law, situation),
            self.effects,
            paper_contact(self.wheel, situation),
        )
        at = self._soil(context.c, context.tan_phi, context.k, situation)
        c, tan_phi, k = (x * (1.0 + SOIL_STEP) for x in (context.c, context.tan_phi, context.k))
        near = self._soil(c, tan_phi, k, situation)
        cohesive, rubbing = (float(law.strength * part) for part in (law.adhesion, law.friction))

        def line(x: float, y: float, moved: float, factor: float) -> tuple[float, float]:
            slope = (moved - y) / (x * SOIL_STEP) if x else 1.0
            return factor * slope, factor * (y - slope * x)

        return Here(
            *line(context.c, float(at.cohesion), float(near.cohesion), cohesive),
            *line(context.tan_phi, float(at.tan_phi), float(near.tan_phi), rubbing),
            *line(context.k, float(at.shear_modulus), float(near.shear_modulus), 1.0),
        )

    def _soil(self, c: float, tan_phi: float, k: float, situation: Situation) -> Soil:
        soil = Soil(c, tan_phi, k, self._exponent, self._modulus)
        return reduce(lambda soil, e: e.soil(soil, situation), self.effects, soil)

    def remember(
        self, memory: Mapping[str, Recall], step: float, situation: Complete
    ) -> dict[str, Recall]:
        """What the effects remember, `step` [s] later."""
        return {
            e.name: e.remember(memory.get(e.name, e.at_start), step, situation)
            for e in self.effects
            if type(e).remember is not Effect.remember
        }

    def fresh_memory(self) -> dict[str, Recall]:
        """What effects and discrepancy remember before the run."""
        of_effects = {
            e.name: e.at_start for e in self.effects if type(e).remember is not Effect.remember
        }
        return of_effects if self.form is None else {**of_effects, FORM: ()}


def _travel_speed(situation: Situation, slip: float) -> float:
    """The carriage speed [m/s] at which the wheel has this slip; as measured where it has it."""
    rim, travel = float(situation.radius * situation.wheel_speed), float(situation.carriage_speed)
    if slip == situation.slip or rim * travel <= 0.0:
        return travel
    return rim * (1.0 - slip) if slip >= 0.0 else rim / (1.0 + slip)


def variants(settings: Settings) -> list[tuple[Effect, ...]]:
    """The configured effects with one uncertain parameter moved by its sigma, for each such
    parameter in turn.
    """
    moved = []
    for effect in settings.effects:
        for name, value in effect.parameters.items():
            if value.sigma > 0.0:
                moved.append(configured(_moved(settings.effects, effect, name)))
    return moved


def _moved(
    effects: tuple[ConfiguredEffect, ...], moved: ConfiguredEffect, name: str
) -> tuple[ConfiguredEffect, ...]:
    value = moved.parameters[name]
    bounds = next(p for p in type(make(moved.name, {})).parameters() if p.name == name)
    up = min(value.value + value.sigma, bounds.high)
    parameters = {**moved.parameters, name: replace(value, value=up)}
    return tuple(replace(e, parameters=parameters) if e is moved else e for e in effects)


def with_latencies(settings: Settings) -> Settings:
    """The settings with a configured sensor latency in the channels' own, and a horizon that waits
    for the slowest.
    """
    delays = {
        key: value.value
        for effect in settings.effects
        if effect.name == "sensor_latency"
        for key, value in effect.parameters.items()
    }
    if not any(delays.values()):
        return settings

    names = {"sinkage_pot": "sinkage", "motor_shunt": "current"}
    channels = {
        name: replace(channel, latency=channel.latency + delays.get(names.get(name, ""), 0.0))
        for name, channel in settings.channels.items()
    }
    wrench = settings.wrench and replace(
        settings.wrench, latency=settings.wrench.latency + delays.get("force", 0.0)
    )
    horizon = settings.rates.horizon + max(0.0, *delays.values())

    return replace(
        settings, channels=channels, wrench=wrench, rates=replace(settings.rates, horizon=horizon)
    )


def _reacts(effect: Effect) -> bool:
    """Whether an effect changes forces or sinkage after the balance, whatever its stage."""
    own = type(effect)
    late = own.wheel is not Effect.wheel or own.testbed is not Effect.testbed
    return late or effect.stage in ("wheel", "testbed", "any")
