"""The adapter for a wheel in soil: recordings and configuration in, channels predicted by the
forward model out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from gritd.estimator.config.effects import configured
from gritd.estimator.config.settings import ConfiguredEffect, Settings
from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import Effect
from gritd.estimator.effects.empirical_law import EmpiricalLaw
from gritd.tools.diagnose.orders.campaigns import NO_LINES, Lines
from gritd.tools.diagnose.rig.constants import (
    UNITS,
    noise_of_readings,
    preparation,
    raised_to_floors,
    wheel_constants,
)
from gritd.tools.diagnose.rig.form import wheel_forms
from gritd.tools.diagnose.rig.full_rate import aligned
from gritd.tools.diagnose.rig.held import held_form
from gritd.tools.diagnose.rig.interface import (
    Bools,
    Constant,
    FormSource,
    GridRun,
    Held,
    LawForm,
    Rig,
    RigWords,
)
from gritd.tools.diagnose.rig.measured_runs import (
    HOLDING_NOTE,
    measured_runs,
    torque_is_held,
    without_torque_at_rest,
)
from gritd.tools.diagnose.rig.motion_error import errors_of_motion
from gritd.tools.diagnose.rig.prediction import Prediction
from gritd.tools.diagnose.rig.proposals import MENU
from gritd.tools.diagnose.rig.recorded import Recorded, measured_of, recorded, to_one_side
from gritd.tools.diagnose.rig.relief import reliefs_of
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.weights import MEASURED_NOTE, WeightSets
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN

Bed = Literal["same", "prepared"]

LEFT_OUT = ("empirical_law",)  # stands for what has no name
SMOOTH = (
    ("slip",), ("speed",), ("load",), ("sinkage",), ("slip", "load"), ("slip", "speed"),
    ("slip", "sinkage"), ("speed", "load"), ("speed", "sinkage"), ("load", "sinkage"),
)  # fmt: skip
LAW_PREFIX = {
    "torque": "torque", "axle_torque": "torque", "drawbar_pull": "pull", "sinkage": "depth",
}  # fmt: skip
AXIS_FRICTION = "load_axis_friction"
LAW_CHANNEL = {"torque": "torque", "pull": "drawbar_pull", "depth": "sinkage"}
LOSS_NOTE = (
    "Motor current and axle torque are both measured, so channel torque is what is lost between"
    " motor and axle. No soil acts there."
)
LAW_TERMS = {"constant": "1", "slip": "i", "slip_squared": "i²", "sinkage": "z/r", "speed": "ν"}
LAW_NOTE = "ν = ln((rω + 1 mm/s)/(21 mm/s))"


def wheel_rig(
    signals: Sequence[Signals],
    settings: Settings,
    reference: int = 0,
    bed: Bed = "prepared",
    read_off: bool = True,
    lines: Lines = NO_LINES,
    had: Sequence[ConfiguredEffect] = (),
) -> Rig:
    """A wheel in soil.

    reference: how many of the runs, the first ones, are of a reference campaign, in which no
    candidate acts; bed: whether the others drive on the same bed or on one prepared anew;
    read_off: where both torques are measured, channel torque is the loss between them;
    lines: what the recordings show at their own rate; had: effects beyond the configured ones that
    the rig has in both campaigns.
    """
    signals = to_one_side(signals)
    again = partial(wheel_rig, signals, settings, reference, bed, read_off, lines)
    alone = partial(_reference_alone, signals[:reference], settings, read_off, lines)

    data = recorded(signals, settings, reference, read_off)
    candidates = _candidates(data, settings.effects)
    settings = replace(settings, effects=_acting(settings.effects, data.stated))
    had = _acting(had, data.stated)
    acting = replace(settings, effects=(*settings.effects, *had))  # in both campaigns

    anew = bool(reference) and bed == "prepared"
    prepared = preparation(settings) if anew else {}
    constants = (
        *wheel_constants(settings, data.channels, data.sets, had),
        *(Constant(f"new_{n}", 0.0, sigma, changes=n) for n, sigma in prepared.items()),
    )
    runs = measured_runs(data, acting, constants)
    holding = "torque" in data.channels and torque_is_held(runs)
    runs = without_torque_at_rest(runs) if holding else runs

    held = _held(data, settings, runs)
    prediction = Prediction(acting, data, constants, tuple(prepared), held)
    motion_sigma, unrest = errors_of_motion(prediction.channels, constants, data, settings)
    surfaces = reliefs_of(runs, data.channels, settings) if anew else ()

    return Rig(
        runs=runs,
        channels=data.channels,
        units=UNITS,
        constants=constants,
        effects=candidates,
        new=data.new,
        predict=prediction.channels,
        words=_words(data, settings, runs, holding),
        smooth=SMOOTH,
        heated=("torque",),
        foresee=prediction.foresee,
        having=lambda more: again((*had, *more)),
        reference=alone if reference else None,
        baseline=configured(settings.effects),
        slipping="carriage_scale",
        partial=_partial(data.sets),
        forms=_forms(data, runs, settings),
        held=held,
        lines=lines,
        loss_of_drive=data.loss,
        tabled=data.tabled,
        stated_noise={} if data.tabled else noise_of_readings(settings, data.loss),
        motion_sigma=motion_sigma,
        nuisances=() if data.tabled else (*unrest, *surfaces),
    )


def _held(data: Recorded, settings: Settings, runs: Sequence[GridRun]) -> Held | None:
    """What the configuration has learnt of the form, in these runs."""
    if settings.discrepancy is None:
        return None
    radius = settings.wheel.radius
    return held_form(settings.discrepancy, runs, data.channels, radius, data.loss)


def _forms(data: Recorded, runs: Sequence[GridRun], settings: Settings) -> tuple[FormSource, ...]:
    constant = settings.drive.torque_constant.value
    motor = [measured_of(s, "torque", constant) for s in data.signals] if data.loss else None
    return wheel_forms(runs, data.channels, settings.wheel.radius, motor)


def _partial(sets: WeightSets) -> dict[str, tuple[str, Sequence[Bools]]]:
    """What one set of weights is off by for itself does to its own values, marked (n,), what
    a common error does to all.
    """
    return {
        name: ("weights", [label == number for label in sets.label])
        for number, name in enumerate(sets.names)
    }


# ---- what is said --------------------------------------------------------------------------------


def _words(data: Recorded, settings: Settings, runs: Sequence[GridRun], holding: bool) -> RigWords:
    caveats = tuple(_sentences(data, settings, holding))
    shortcomings = tuple(_shortcomings(runs, data.channels))
    return RigWords(caveats, MENU, shortcomings, _law(settings.wheel.radius, data.loss))


def _law(radius: float, loss: bool) -> LawForm:
    domain = {"slip": 1.0, "sinkage": radius, "speed": 1.0}
    prefix, channel = LAW_PREFIX, LAW_CHANNEL
    if loss:  # the soil acts behind the drive
        prefix = {c: name for c, name in prefix.items() if c != "torque"}
        channel = channel | {"torque": "axle_torque"}
    return LawForm(EmpiricalLaw, prefix, channel, LAW_TERMS, LAW_NOTE, domain)


def _shortcomings(runs: Sequence[GridRun], channels: Sequence[str]) -> Iterator[str]:
    loads = np.concatenate([run.covariates["load"] for run in runs])
    if np.ptp(loads) < TUNING.rig.close_load * max(float(np.max(loads)), SPAN):
        yield (
            "One load only: c and tan φ are nearly inseparable, and so are effects that differ"
            " by load alone."
        )
    if "drawbar_pull" not in channels:
        yield "No force sensor: what acts on the drawbar pull alone cannot show."


def _sentences(data: Recorded, settings: Settings, holding: bool) -> Iterator[str]:
    """What to know of the comparison; holding: a servo holds torque at rest."""
    yield from (s.left_out for s in data.signals if s.left_out)
    if not data.stated:
        yield MEASURED_NOTE
    if data.loss:
        yield LOSS_NOTE
    if sentence := raised_to_floors(settings):
        yield sentence
    if holding:
        yield HOLDING_NOTE


# ---- pieces --------------------------------------------------------------------------------------


def _reference_alone(
    signals: Sequence[Signals], settings: Settings, read_off: bool, lines: Lines
) -> Rig:
    """Its runs and lines as those of a campaign of its own."""
    own = Lines(lines.reference, configured=lines.configured)
    signals, own = aligned(signals, own)
    return wheel_rig(signals, settings, read_off=read_off, lines=own)


def _candidates(data: Recorded, known: Sequence[ConfiguredEffect]) -> dict[str, type[Effect]]:
    """The effects to look for, by name: of steady states only what they can show."""
    left_out = {*LEFT_OUT, *(effect.name for effect in known)}
    if not data.stated:
        left_out.add(AXIS_FRICTION)

    listed = {n: e for n, e in EFFECTS.items() if not e.filter_only and n not in left_out}
    if "side_force" not in data.channels:
        listed = {name: effect.without_side_force() for name, effect in listed.items()}
    if not data.tabled:
        return listed
    shown = {name: effect.in_steady_states() for name, effect in listed.items()}
    return {name: effect for name, effect in shown.items() if effect is not None}


def _acting(
    effects: Sequence[ConfiguredEffect], weights_stated: bool
) -> tuple[ConfiguredEffect, ...]:
    """Those of some effects that act: a measured load that drives the balance holds the friction of
    its axis already.
    """
    return tuple(e for e in effects if weights_stated or e.name != AXIS_FRICTION)
