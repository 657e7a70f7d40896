"""The adapter for a wheel in soil: recordings and configuration in, channels predicted by the
forward model out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Literal

import numpy as np

from gritd.estimator.config.effects import configured
from gritd.estimator.config.settings import Settings
from gritd.estimator.effects import make
from gritd.estimator.effects.base import Effect
from gritd.estimator.effects.empirical_law import EmpiricalLaw
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.tools.diagnose.orders.campaigns import NO_LINES, Lines
from gritd.tools.diagnose.orders.latency import Latency
from gritd.tools.diagnose.rig.blur import blur_of
from gritd.tools.diagnose.rig.campaign import Campaign, sensed_as
from gritd.tools.diagnose.rig.candidates import candidates, tables
from gritd.tools.diagnose.rig.constants import UNITS, preparation, wheel_constants
from gritd.tools.diagnose.rig.covariates import covariates
from gritd.tools.diagnose.rig.form import wheel_forms
from gritd.tools.diagnose.rig.held import HeldForm
from gritd.tools.diagnose.rig.interface import Bools, Constant, Foreseen, Index, LawForm, Run, Stack
from gritd.tools.diagnose.rig.proposals import driving, proposed
from gritd.tools.diagnose.rig.recorded import channels_of, loss_measured, measured_of, motion_of
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.states import states
from gritd.tools.diagnose.rig.unrest import unrest_in
from gritd.tools.diagnose.rig.weight_sets import weight_sets
from gritd.tools.diagnose.rig.weights import weights_of
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN

# constants that need the forward model
PHYSICS = ("c", "tan_phi", "k", "n", "K", "weights", "carriage_scale")
LEFT_OUT = ("empirical_law",)  # stands for what has no name

Bed = Literal["same", "prepared"]


LAW_PREFIX = {
    "torque": "torque", "axle_torque": "torque", "drawbar_pull": "pull", "sinkage": "depth",
}  # fmt: skip
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
    heated = ("torque",)
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
    ) -> None:
        """reference: how many of the runs, the first ones, are of a reference campaign, in which no
        candidate acts; bed: whether the others drive on the same bed or on one prepared anew;
        read_off: where both torques are measured, channel torque is the loss between them;
        lines, latencies: what the recordings show at their own rate.
        """
        self.settings, self.lines, self.latencies = settings, lines, latencies
        self.new = [number >= reference for number in range(len(signals))]
        self.caveats = [s.left_out for s in signals if s.left_out]
        self._weights = [weights_of(s, settings, self.caveats) for s in signals]
        self.channels = channels_of(signals, settings, [w.known for w in self._weights])
        began = {
            new: min(s.start for s, n in zip(signals, self.new, strict=True) if n == new)
            for new in set(self.new)
        }
        self.loss_of_drive = read_off and loss_measured(signals, self.channels)
        if self.loss_of_drive:
            self.caveats.append(LOSS_NOTE)
        self._tabled = tables(signals)
        self._motions = [
            motion_of(s, w.values, settings, s.start - began[new])
            for s, w, new in zip(signals, self._weights, self.new, strict=True)
        ]
        self._sets = weight_sets([np.asarray(m.load) for m in self._motions])
        self._set = np.concatenate(self._sets.label)  # (N,)
        self.baseline = configured(settings.effects)
        stated = all(w.known for w in self._weights)
        self._prepared = preparation(settings) if reference and bed == "prepared" else {}
        self.held: HeldForm | None = None
        self.constants = (
            *wheel_constants(settings, self.channels, self._sets, stated, self.caveats),
            *(
                Constant(f"new_{name}", 0.0, sigma, changes=name)
                for name, sigma in self._prepared.items()
            ),
        )

        out = {*LEFT_OUT, *(b.name for b in self.baseline)}
        if not stated:  # the measured load that drives the balance holds its friction already
            out.add("load_axis_friction")
        self.effects = candidates(signals, out)

        self._campaigns = [
            (new, Campaign([m for m, n in zip(self._motions, self.new, strict=True) if n == new],
                           settings, self.channels))
            for new in sorted(set(self.new))
        ]  # fmt: skip
        ends = np.cumsum([np.size(m.time) for m in self._motions])
        self._parts = [
            slice(end - np.size(m.time), end) for m, end in zip(self._motions, ends, strict=True)
        ]
        self._kept: dict[tuple[object, ...], Array] = {}
        lengths = np.concatenate(
            [np.full(s.time.size, np.median(np.diff(s.time))) for s in signals]
        )
        self._step: Array = lengths  # [s] grid interval of each value (N,)
        # (N,) with a neighbour of the same run on either side
        self._inner = np.ones(lengths.size, bool)
        for part in self._parts:
            self._inner[[part.start, part.stop - 1]] = False
        self._doubt = [s.doubt for s in signals]
        self.runs = self._without_held_torque([self._run(s, n) for n, s in enumerate(signals)])
        driven = [measured_of(s, "torque", self._constant) for s in signals]
        learnt, lost = settings.discrepancy, ("torque",) if self.loss_of_drive else ()
        self.held = (
            HeldForm(learnt, self.runs, self.channels, settings.wheel.radius, lost)
            if learnt is not None
            else None
        )
        self.forms = wheel_forms(
            self.runs,
            self.channels,
            settings.wheel.radius,
            driven if self.loss_of_drive else None,
        )

    # ---- prediction ------------------------------------------------------------------------------

    def predict(
        self, u: Array, effects: Sequence[Effect], everywhere: bool = False
    ) -> list[dict[str, Array]]:
        """See interface.Rig; constants u (q,), channels (n,) of each run."""
        value = {
            constant.name: constant.of(float(x))
            for constant, x in zip(self.constants, u, strict=True)
        }

        baseline = self._baseline(value)
        true = [
            self._true(
                value, (*baseline, *effects) if new or everywhere else baseline, new, campaign
            )
            for new, campaign in self._campaigns
        ]

        read = self._read(np.hstack(true), value)
        told = [dict(zip(self.channels, read[:, part], strict=True)) for part in self._parts]

        if self.held is None:
            return told
        return [
            {channel: values + mean[channel] for channel, values in run.items()}
            for run, mean in zip(told, self.held.means, strict=True)
        ]

    def _true(
        self,
        value: Mapping[str, float],
        effects: tuple[Effect, ...],
        new: bool,
        campaign: Campaign,
    ) -> Array:
        """True readings (channels, n) of one campaign before scale, offset and delay; the last few
        are kept.
        """
        # the last for values without a set of weights of their own
        own = (*(value[name] for name in self._sets.names), 0.0)
        shifts = tuple(value[f"new_{name}"] if new else 0.0 for name in self._prepared)
        physics = (*(value[name] for name in PHYSICS), *shifts, *own, *effects, new)

        if physics not in self._kept:
            if len(self._kept) >= TUNING.rig.kept_simulations:
                self._kept.pop(next(iter(self._kept)))
            weights = 1.0 + value["weights"] + np.array(own)[self._of(new)]
            self._kept[physics] = campaign.readings(
                self._soil(value, new), weights, 1.0 + value["carriage_scale"], effects
            )
        return self._kept[physics]

    def _of(self, new: bool) -> Index:
        """The set of weights of each value of one campaign (n,)."""
        labels = [label for label, n in zip(self._sets.label, self.new, strict=True) if n == new]
        return np.concatenate(labels)

    def _soil(self, value: Mapping[str, float], new: bool) -> Soil:
        """The soil of one campaign: a bed that was prepared anew has its own."""
        shift = {name: np.exp(value[f"new_{name}"]) if new else 1.0 for name in self._prepared}
        names = ("c", "tan_phi", "k", "n", "K")
        return Soil(*(value[name] * float(shift.get(name, 1.0)) for name in names))

    def _read(self, true: Array, value: Mapping[str, float]) -> Array:
        scale, offset, delay, blur = (
            np.array([value[f"{c}_{what}"] for c in self.channels])[:, None]
            for what in ("scale", "offset", "delay", "blur")
        )
        read = true * (1.0 + scale) + offset
        before, after = np.roll(read, 1, axis=1), np.roll(read, -1, axis=1)
        rate, bend = (after - before) / (2.0 * self._step), after + before - 2.0 * read
        return self._compared(np.where(self._inner, read - delay * rate + blur * bend, read))

    def _compared(self, read: Array) -> Array:
        """Of what the channels read (channels, n): the loss of the drive where both its sides are
        measured.
        """
        out = np.array(read)
        if self.loss_of_drive:
            motor, axle = (self.channels.index(name) for name in ("torque", "axle_torque"))
            out[motor] -= read[axle]
        return out

    def _baseline(self, value: Mapping[str, float]) -> tuple[Effect, ...]:
        return tuple(
            make(e.name, {p: value.get(f"{e.name}.{p}", q.value) for p, q in e.parameters.items()})
            for e in self.settings.effects
        )

    @property
    def _constant(self) -> float:
        return self.settings.drive.torque_constant.value

    def unit_factor(self, unit: str) -> float:
        return 1.0

    @property
    def partial(self) -> Mapping[str, tuple[str, Sequence[Bools]]]:
        """What one set of weights is off by for itself does to its own values, marked (n,), what
        a common error does to all.
        """
        return {
            name: ("weights", [label == number for label in self._sets.label])
            for number, name in enumerate(self._sets.names)
        }

    @cached_property
    def motion_sigma(self) -> Sequence[Mapping[str, Array]]:
        """By the encoders' counts (n,): slip is uncertain by what a carriage would make of it that
        is off by as much.
        """
        return [
            {channel: np.abs(change) * doubt for channel, change in by_speed.items()}
            for by_speed, doubt in zip(self._by_carriage, self._doubt, strict=True)
        ]

    @cached_property
    def unrest(self) -> Sequence[Sequence[Mapping[str, Array]]]:
        """Of wheel and carriage; nothing in tables, whose speeds are those of states."""
        return () if self._tabled else unrest_in(self._motions, self._by_carriage)

    @cached_property
    def _by_carriage(self) -> list[dict[str, Array]]:
        """Per run, change of every channel (n,) by ln of the carriage's speed."""
        names = [constant.name for constant in self.constants]
        moved = np.array([float(name == "carriage_scale") for name in names])
        told = zip(self.predict(0.0 * moved, ()), self.predict(moved, ()), strict=True)

        sigma = self.constants[names.index("carriage_scale")].sigma
        return [{c: (two[c] - one[c]) / sigma for c in self.channels} for one, two in told]

    def blur(self, stack: Stack, predicted: Array) -> Array:
        """(N,) by slopes over three intervals, and by an axle that lags."""
        return blur_of(stack, predicted)

    def foresee(self, experiment: str, u: Array, effects: Sequence[Effect]) -> Foreseen:
        """Channels under a proposed experiment (see proposals.py), for constants u (q,) and
        effects as fitted.
        """
        value = {
            constant.name: constant.of(float(x))
            for constant, x in zip(self.constants, u, strict=True)
        }
        soil = self._soil(value, True)
        acting = (*self._baseline(value), *effects)
        motion = proposed(experiment, self._motions, self.settings.wheel.radius)
        sensed = simulate_arrays(
            self.settings.wheel,
            soil,
            motion,
            acting,
            torque_constant=self._constant,
            order=TUNING.rig.quadrature_order,
        ).sensed

        read = [sensed_as(sensed, c, self.settings) + value[f"{c}_offset"] for c in self.channels]
        compared = dict(zip(self.channels, self._compared(np.array(read)), strict=True))
        return Foreseen(compared, {c: driving(experiment) | (c == "torque") for c in self.channels})

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

    def _run(self, signals: Signals, number: int) -> Run:
        motion = self._motions[number]
        measured = {c: measured_of(signals, c, self._constant) for c in self.channels}
        if self.loss_of_drive:
            measured["torque"] = measured["torque"] - measured["axle_torque"]

        along = covariates(signals, motion, self.settings.wheel, self._tabled)
        along["sinkage"] = self._depth(number)

        driving, resting, lifted = states(motion, self.settings)
        still = {"torque": driving | resting | lifted}
        known = np.isfinite(signals.wheel_speed) & np.isfinite(signals.carriage_rate)
        known[: TUNING.rig.slope_edge] = known[-TUNING.rig.slope_edge :] = False

        used = {c: known & still.get(c, driving) & np.isfinite(measured[c]) for c in self.channels}
        return Run(signals.name, np.asarray(motion.time), measured, used, along)

    def _without_held_torque(self, runs: list[Run]) -> list[Run]:
        """A servo may hold torque at rest: where the current at rest differs from rest to rest,
        rest says nothing.
        """
        if "torque" not in self.channels:
            return runs
        still = [run.used["torque"] & (run.covariates["speed"] == 0.0) for run in runs]

        means = [
            float(r.measured["torque"][m].mean())
            for r, m in zip(runs, still, strict=True)
            if m.any()
        ]
        driven = np.concatenate(
            [r.measured["torque"][r.used["torque"] & ~m] for r, m in zip(runs, still, strict=True)]
        )

        if (
            len(means) < 2
            or not driven.size
            or float(np.ptp(means)) < TUNING.rig.holding * float(np.sqrt(np.mean(driven**2)))
        ):
            return runs

        self.caveats.append(
            "The motor holds torque while the wheel stands, so its current at rest tells no offset."
        )
        return [
            replace(run, used={**run.used, "torque": run.used["torque"] & ~mask})
            for run, mask in zip(runs, still, strict=True)
        ]

    def _depth(self, number: int) -> Array:
        """Sinkage predicted from the prior: the measured one carries the noise of its channel."""
        motion, prior = (
            self._motions[number],
            {constant.name: constant.value for constant in self.constants},
        )
        soil = Soil(prior["c"], prior["tan_phi"], prior["k"], prior["n"], prior["K"])
        return simulate_arrays(
            self.settings.wheel, soil, motion, self.baseline, order=TUNING.rig.quadrature_order
        ).sinkage
