"""The adapter for a wheel in soil: recordings and configuration in, channels predicted by the
forward model out.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import cached_property, partial
from typing import Literal

import numpy as np

from gritd.estimator.config.effects import configured
from gritd.estimator.config.settings import ConfiguredEffect, Settings
from gritd.estimator.effects.base import Effect
from gritd.estimator.effects.empirical_law import EmpiricalLaw
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.tools.diagnose.orders.campaigns import NO_LINES, Lines
from gritd.tools.diagnose.orders.latency import Latency
from gritd.tools.diagnose.orders.phases import guide
from gritd.tools.diagnose.rig.blur import blur_of, blur_of_reversal
from gritd.tools.diagnose.rig.candidates import candidates, tables
from gritd.tools.diagnose.rig.constants import UNITS, preparation, raised_to_floors, wheel_constants
from gritd.tools.diagnose.rig.form import wheel_forms
from gritd.tools.diagnose.rig.full_rate import aligned
from gritd.tools.diagnose.rig.held import HeldForm
from gritd.tools.diagnose.rig.interface import (
    Bools,
    Constant,
    Foreseen,
    FormSource,
    GridRun,
    LawForm,
)
from gritd.tools.diagnose.rig.load_error import load_errors_in
from gritd.tools.diagnose.rig.measured_runs import (
    HOLDING_NOTE,
    idle_values,
    measured_run,
    sinkage_from_prior,
    torque_is_held,
    without_torque_at_rest,
)
from gritd.tools.diagnose.rig.prediction import SOIL, Driven, Prediction
from gritd.tools.diagnose.rig.proposals import MENU
from gritd.tools.diagnose.rig.recorded import (
    channels_of,
    loss_measured,
    measured_of,
    motion_of,
    to_one_side,
)
from gritd.tools.diagnose.rig.relief import height_of, reliefs_of
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.stated_noise import noise_of_readings
from gritd.tools.diagnose.rig.states import after_reversal
from gritd.tools.diagnose.rig.unrest import unrest_in
from gritd.tools.diagnose.rig.weight_sets import weight_sets
from gritd.tools.diagnose.rig.weights import MEASURED_NOTE, Weights, weights_in
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN

LEFT_OUT = ("empirical_law",)  # stands for what has no name

Bed = Literal["same", "prepared"]


LAW_PREFIX = {
    "torque": "torque", "axle_torque": "torque", "drawbar_pull": "pull", "sinkage": "depth",
}  # fmt: skip
AXIS_FRICTION = "load_axis_friction"
LAW_CHANNEL = {"torque": "torque", "pull": "drawbar_pull", "depth": "sinkage"}
LAW_PREFIX_OF_LOSS = {c: prefix for c, prefix in LAW_PREFIX.items() if c != "torque"}
LOSS_NOTE = (
    "Motor current and axle torque are both measured, so channel torque is what is lost between"
    " motor and axle. No soil acts there."
)
LAW_TERMS = {"constant": "1", "slip": "i", "slip_squared": "i²", "sinkage": "z/r", "speed": "ν"}
LAW_NOTE = "ν = ln((rω + 1 mm/s)/(21 mm/s))"


class WheelRig:
    """See interface.Rig."""

    units: Mapping[str, str] = UNITS
    menu = MENU
    heated = ("torque",)
    slipping = "carriage_scale"
    smooth = (
        ("slip",), ("speed",), ("load",), ("sinkage",), ("slip", "load"), ("slip", "speed"),
        ("slip", "sinkage"), ("speed", "load"), ("speed", "sinkage"), ("load", "sinkage"),
    )  # fmt: skip

    def __init__(
        self,
        signals: Sequence[Signals],
        settings: Settings,
        reference: int = 0,
        bed: Bed = "prepared",
        read_off: bool = True,
        lines: Lines = NO_LINES,
        latencies: Sequence[Latency] = (),
        had: Sequence[ConfiguredEffect] = (),
    ) -> None:
        """reference: how many of the runs, the first ones, are of a reference campaign, in which no
        candidate acts; bed: whether the others drive on the same bed or on one prepared anew;
        read_off: where both torques are measured, channel torque is the loss between them;
        lines, latencies: what the recordings show at their own rate; had: effects beyond the
        configured ones that the rig has in both campaigns.
        """
        signals = to_one_side(signals)
        self._again = partial(
            WheelRig, signals, settings, reference, bed, read_off, lines, latencies
        )
        self._alone = partial(_reference_alone, signals[:reference], settings, read_off, lines)
        self._weights = weights = weights_in(signals, settings)
        stated = all(w.known for w in weights)
        known = [effect.name for effect in settings.effects]
        settings = replace(settings, effects=_acting(settings.effects, stated))
        had = _acting(had, stated)

        self.baseline = configured(settings.effects)
        self.settings, self.lines, self.latencies = settings, lines, latencies
        self.new = [number >= reference for number in range(len(signals))]
        self.tabled, self._doubt = tables(signals), [s.doubt for s in signals]
        self.channels = channels_of(signals, settings, [w.known for w in weights])
        self.loss_of_drive = read_off and loss_measured(signals, self.channels)

        stated_noise = noise_of_readings(settings, self.loss_of_drive)
        self.stated_noise = {} if self.tabled else stated_noise  # no row is a reading
        self._driven = _driven(signals, weights, self.new, settings)
        self._idle = (
            idle_values(signals, self._driven.motions, settings) if self.loss_of_drive else None
        )
        self._anew = bool(reference) and bed == "prepared"
        prepared = preparation(settings) if self._anew else {}
        self.constants = (
            *wheel_constants(settings, self.channels, self._driven.sets, stated, had),
            *(Constant(f"new_{n}", 0.0, sigma, changes=n) for n, sigma in prepared.items()),
        )
        self.effects = candidates(signals, _left_out(known, stated))
        self._acting = replace(settings, effects=(*settings.effects, *had))
        self._prediction = Prediction(
            self._acting,
            self.channels,
            self.constants,
            self._driven,
            tuple(prepared),
            self._idle,
        )

        runs = self._measured(signals)
        holding = "torque" in self.channels and torque_is_held(runs)
        self.runs = without_torque_at_rest(runs) if holding else runs
        self.caveats = [*self._sentences(signals, holding)]
        self.held = self._held_form()
        self.forms = self._forms(signals)

    # ---- its reference ---------------------------------------------------------------------------

    @property
    def reference(self) -> WheelRig | None:
        """See interface.Rig."""
        return None if all(self.new) else self._alone()

    def having(self, effects: Sequence[ConfiguredEffect]) -> WheelRig:
        """See interface.Rig."""
        return self._again(effects)

    # ---- prediction ------------------------------------------------------------------------------

    def predict(
        self, u: Array, effects: Sequence[Effect], everywhere: bool = False
    ) -> list[dict[str, Array]]:
        """See interface.Rig; constants u (q,), channels (n,) of each run."""
        told = self._prediction.channels(u, effects, everywhere)
        if self.held is None:
            return told
        return [
            {channel: values + mean[channel] for channel, values in run.items()}
            for run, mean in zip(told, self.held.means, strict=True)
        ]

    def aside(self) -> AbstractContextManager[None]:
        """See interface.Rig."""
        return self._prediction.aside()

    def foresee(self, experiment: str, u: Array, effects: Sequence[Effect]) -> Foreseen:
        """See interface.Rig; constants u (q,)."""
        return self._prediction.foresee(experiment, u, effects)

    def unit_factor(self, unit: str) -> float:
        return 1.0

    def recorded(self, channel: str) -> tuple[str, ...]:
        """Of the drive's loss, the torques on both its sides."""
        lost = self.loss_of_drive and channel == "torque"
        return ("torque", "axle_torque") if lost else (channel,)

    @property
    def partial(self) -> Mapping[str, tuple[str, Sequence[Bools]]]:
        """What one set of weights is off by for itself does to its own values, marked (n,), what
        a common error does to all.
        """
        sets = self._driven.sets
        return {
            name: ("weights", [label == number for label in sets.label])
            for number, name in enumerate(sets.names)
        }

    @cached_property
    def motion_sigma(self) -> Sequence[Mapping[str, Array]]:
        """By the encoders' counts (n,): slip is uncertain by what a carriage would make of it that
        is off by as much. By the noise of a measured load.
        """
        told = [
            {channel: np.abs(change) * doubt for channel, change in by_speed.items()}
            for by_speed, doubt in zip(self._by_carriage, self._doubt, strict=True)
        ]
        if all(one.known for one in self._weights):
            return told
        return [
            {c: np.hypot(values, by_load[c] * _relative_noise(one)) for c, values in run.items()}
            for run, by_load, one in zip(told, self._by_load, self._weights, strict=True)
        ]

    @cached_property
    def unrest(self) -> Sequence[Sequence[Mapping[str, Array]]]:
        """Of wheel, carriage and measured load, channels (n,) of each run; nothing in tables, whose
        values are those of states.
        """
        if self.tabled:
            return ()
        speeds = unrest_in(self._driven.motions, self._by_carriage)
        if all(one.known for one in self._weights):
            return speeds
        return [*speeds, *load_errors_in(self._weights, self._by_load)]

    @cached_property
    def reliefs(self) -> Sequence[Sequence[Mapping[str, Array]]]:
        """Of each run, channels (n,); none on a bed that was not touched, and none in tables."""
        if self.tabled or not self._anew or "sinkage" not in self.channels:
            return ()
        return list(reliefs_of(self.runs, self.channels, height_of(self.settings)))

    @cached_property
    def _by_carriage(self) -> list[dict[str, Array]]:
        """Per run, change of every channel (n,) by ln of the carriage's speed."""
        return self._by("carriage_scale")

    @cached_property
    def _by_load(self) -> list[dict[str, Array]]:
        """Per run, change of every channel (n,) by ln of the load."""
        return self._by("weights")

    def _by(self, name: str) -> list[dict[str, Array]]:
        """Per run, change of every channel (n,) by a relative constant."""
        names = [constant.name for constant in self.constants]
        moved = np.array([float(other == name) for other in names])
        told = zip(self.predict(0.0 * moved, ()), self.predict(moved, ()), strict=True)

        sigma = self.constants[names.index(name)].sigma
        return [{c: (two[c] - one[c]) / sigma for c in self.channels} for one, two in told]

    def blur(self, stack: Stack, predicted: Array) -> Array:
        """(N,) by slopes over three intervals, by an axle that lags, and by a motion that turns
        back inside an interval.
        """
        blur = blur_of(stack, predicted)
        if self.tabled or "torque" not in self.channels:
            return blur
        after = [after_reversal(motion, self.settings) for motion in self._driven.motions]
        return np.hypot(blur, blur_of_reversal(stack, predicted, after))

    # ---- what is said ----------------------------------------------------------------------------

    @property
    def law(self) -> LawForm:
        domain = {"slip": 1.0, "sinkage": self.settings.wheel.radius, "speed": 1.0}
        if self.loss_of_drive:
            channel = LAW_CHANNEL | {"torque": "axle_torque"}
            return LawForm(EmpiricalLaw, LAW_PREFIX_OF_LOSS, channel, LAW_TERMS, LAW_NOTE, domain)
        return LawForm(EmpiricalLaw, LAW_PREFIX, LAW_CHANNEL, LAW_TERMS, LAW_NOTE, domain)

    @property
    def shortcomings(self) -> list[str]:
        sentences = []
        loads = np.concatenate([run.covariates["load"] for run in self.runs])
        if np.ptp(loads) < TUNING.rig.one_load * max(float(np.max(loads)), SPAN):
            sentences.append(
                "One load only: c and tan φ are nearly inseparable, and so are effects that differ"
                " by load alone."
            )
        if "drawbar_pull" not in self.channels:
            sentences.append("No force sensor: what acts on the drawbar pull alone cannot show.")
        return sentences

    # ---- what was recorded -----------------------------------------------------------------------

    def _measured(self, signals: Sequence[Signals]) -> list[GridRun]:
        prior = {constant.name: constant.value for constant in self.constants}
        soil = Soil(*(prior[name] for name in SOIL))
        idles: Sequence[Bools | None] = self._idle or [None for _ in signals]

        return [
            measured_run(
                one,
                motion,
                self.settings,
                self.channels,
                sinkage_from_prior(motion, self.settings, soil, configured(self._acting.effects)),
                idle,
                self.tabled,
            )
            for one, motion, idle in zip(signals, self._driven.motions, idles, strict=True)
        ]

    def _sentences(self, signals: Sequence[Signals], holding: bool) -> Iterator[str]:
        """What to know of the comparison; holding: a servo holds torque at rest."""
        yield from (s.left_out for s in signals if s.left_out)
        if not all(w.known for w in self._weights):
            yield MEASURED_NOTE
        if self.loss_of_drive:
            yield LOSS_NOTE
        if sentence := raised_to_floors(self.settings):
            yield sentence
        if holding:
            yield HOLDING_NOTE

    def _held_form(self) -> HeldForm | None:
        learnt = self.settings.discrepancy
        if learnt is None:
            return None
        lost = ("torque",) if self.loss_of_drive else ()
        return HeldForm(learnt, self.runs, self.channels, self.settings.wheel.radius, lost)

    def _forms(self, signals: Sequence[Signals]) -> tuple[FormSource, ...]:
        motor = None
        if self.loss_of_drive:
            constant = self.settings.drive.torque_constant.value
            motor = [measured_of(s, "torque", constant) for s in signals]
        return wheel_forms(self.runs, self.channels, self.settings.wheel.radius, motor)


def _reference_alone(
    signals: Sequence[Signals], settings: Settings, read_off: bool, lines: Lines
) -> WheelRig:
    """Its runs and lines as those of a campaign of its own."""
    own = Lines(lines.reference, configured=lines.configured)
    line = guide(own)
    own = replace(own, aligned=line.at if line else 0.0)
    return WheelRig(aligned(signals, line), settings, read_off=read_off, lines=own)


def _driven(
    signals: Sequence[Signals], weights: Sequence[Weights], new: Sequence[bool], settings: Settings
) -> Driven:
    """Each campaign's time begins with its first run."""
    began = {
        which: min(s.start for s, n in zip(signals, new, strict=True) if n == which)
        for which in set(new)
    }
    motions = [
        motion_of(s, w.values, settings, s.start - began[n])
        for s, w, n in zip(signals, weights, new, strict=True)
    ]

    steps = [float(np.median(np.diff(s.time))) for s in signals]
    return Driven(motions, steps, new, weight_sets([w.sets for w in weights]))


def _relative_noise(weights: Weights) -> Array:
    """Of measured weights (n,); nothing where the wheel is lifted."""
    carried = weights.values > TUNING.rig.raised * weights.values.max()
    return np.where(carried, weights.sigma / np.where(carried, weights.values, 1.0), 0.0)


def _left_out(known: Collection[str], weights_stated: bool) -> set[str]:
    """Effects that are no candidates."""
    names = {*LEFT_OUT, *known}
    return names if weights_stated else names | {AXIS_FRICTION}


def _acting(
    effects: Sequence[ConfiguredEffect], weights_stated: bool
) -> tuple[ConfiguredEffect, ...]:
    """Those of some effects that act: a measured load that drives the balance holds the friction of
    its axis already.
    """
    return tuple(e for e in effects if weights_stated or e.name != AXIS_FRICTION)
