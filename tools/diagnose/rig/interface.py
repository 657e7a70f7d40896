"""What the engine needs of a rig: runs on a time grid, a prediction of the channels, what is known
of its constants.

A rig is one small class: `WheelRig` for a wheel in soil, `DriveRig` for a motor drive without soil.
The other rooms work on the arrays defined here and know a rig by this interface alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.settings import ConfiguredEffect
from gritd.estimator.effects.base import Effect
from gritd.estimator.model.discrepancy import Usual
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.orders.campaigns import Lines
from gritd.tools.diagnose.orders.latency import Latency

if TYPE_CHECKING:
    from gritd.tools.diagnose.rig.stack import Stack

Bools = NDArray[np.bool_]
Index = NDArray[np.intp]
HAD = "had"  # kind of a constant: a parameter of an effect that a reference shows by itself


@dataclass(frozen=True)
class Constant:
    """A constant of the base model: its prior N(0, 1) is on `u`, and its value is what `of` makes
    of u.

    log: value · exp(u σ/value), for what is positive and known to a share; else value + u σ, kept
        inside low … high.
    changes: the constant whose value in the new campaign is e^this times that in the reference.
    channel, kind: of a calibration, what it is of: its scale, offset, delay or blur; or HAD.
    """

    name: str
    value: float
    sigma: float
    unit: str = ""
    soil: bool = False
    log: bool = False
    low: float = -np.inf
    high: float = np.inf
    changes: str = ""
    channel: str = ""
    kind: str = ""

    @property
    def parameter(self) -> tuple[str, str]:
        """Effect and parameter, where the constant is one of an effect that the rig has."""
        effect, _, parameter = self.name.partition(".")
        return effect, parameter

    def of(self, u: float) -> float:
        if self.log:
            return float(self.value * np.exp(u * self.sigma / self.value))
        return float(np.clip(self.value + u * self.sigma, self.low, self.high))

    def strain(self, value: float) -> float:
        """u of a value: the inverse of `of`."""
        if self.log:
            return float(np.log(value / self.value) * self.value / self.sigma)
        return (value - self.value) / self.sigma

    def spread(self, u: float, sigma_u: float) -> float:
        """Standard deviation of the value for one of u."""
        return float(sigma_u * self.sigma * (self.of(u) / self.value if self.log else 1.0))


@dataclass(frozen=True)
class GridRun:
    """One run on the analysis grid; arrays (n,). `used` says which values of a channel the
    comparison counts; `idle` is 1 where a torque is the motor's alone that else is a loss, else 0.
    """

    name: str
    time: Array  # [s] since the campaign began
    measured: Mapping[str, Array]
    used: Mapping[str, Bools]
    covariates: Mapping[str, Array]
    idle: Mapping[str, Array]


@dataclass(frozen=True)
class Foreseen:
    """Channels under an experiment that was not driven yet, and which of their values would tell
    something; arrays (n,).
    """

    channels: Mapping[str, Array]
    tells: Mapping[str, Bools]


@dataclass(frozen=True)
class Menu:
    """Experiments that may be proposed.

    driven:    those that a rig may foresee, the least effort first.
    along:     of a covariate, the experiment that shows the shape of a misfit along it.
    otherwise: the experiment where none of these does.
    """

    driven: tuple[str, ...]
    along: Mapping[str, str]
    otherwise: str


@dataclass(frozen=True)
class LawForm:
    """How an effect of the library expresses a misfit without a name: a sum of few terms in one
    channel.

    prefix:  of each channel that has a law, how the names of its parameters begin.
    channel: of each prefix, the channel in which the law is stated.
    terms:   how the names of the parameters end, and the symbol of each term.
    note:    what the symbols mean.
    domain:  covariates of which a domain is kept, and the size of one unit of the effect in SI.
    """

    effect: type[Effect]
    prefix: Mapping[str, str]
    channel: Mapping[str, str]
    terms: Mapping[str, str]
    note: str
    domain: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class FormSource:
    """Where the form of the model may be off: a smooth function of the conditions, the same in all
    of its channels.

    conditions: per run (n, d), each in units of the length over which the function changes.
    weight:     per run (n,), how large the function is there, in `size`.
    size:       in the unit of its channels; None: the root mean square of its last channel.
    drive:      whether it is the drive's and not the soil's.
    usual:      load and speed that the conditions are counted from, where there is soil.
    """

    name: str
    channels: tuple[str, ...]
    conditions: tuple[Array, ...]
    weight: tuple[Array, ...]
    size: float | None = None
    drive: bool = False
    usual: Usual | None = None

    @property
    def count(self) -> int:
        """Conditions."""
        return int(self.conditions[0].shape[1])


class Held(Protocol):
    """The learnt discrepancy that a configuration holds already."""

    @property
    def means(self) -> Sequence[Mapping[str, Array]]:
        """Per run, mean (n,) in every channel, in its unit."""

    def doubts(self, stack: Stack) -> Array:
        """Columns (N, t) of unit normal weights: what is left open of it."""


class Rig(Protocol):
    """The adapter."""

    caveats: list[str]

    @property
    def runs(self) -> Sequence[GridRun]: ...

    @property
    def channels(self) -> tuple[str, ...]: ...

    @property
    def units(self) -> Mapping[str, str]:
        """Of channels and covariates."""

    @property
    def constants(self) -> tuple[Constant, ...]: ...

    @property
    def partial(self) -> Mapping[str, tuple[str, Sequence[Bools]]]:
        """Constants that do to some values, marked per run (n,), what another constant does to all:
        a cheap derivative.
        """

    @property
    def effects(self) -> Mapping[str, type[Effect]]:
        """The candidates."""

    @property
    def baseline(self) -> tuple[Effect, ...]:
        """Effects of the configuration: the model has them already."""

    @property
    def new(self) -> Sequence[bool]:
        """Of each run, whether candidates act in it; all of them where there is no reference."""

    @property
    def reference(self) -> Rig | None:
        """The rig with the runs of the reference alone; None where there is none."""

    def having(self, effects: Sequence[ConfiguredEffect]) -> Rig:
        """The rig with effects in both campaigns, whose parameters are constants. A candidate of
        the same name is what is new of it.
        """

    @property
    def forms(self) -> tuple[FormSource, ...]:
        """Where the form of the model may be off."""

    @property
    def held(self) -> Held | None:
        """What of it the configuration holds already, where it does."""

    @property
    def lines(self) -> Lines:
        """Ripples that the recordings show at their own rate."""

    def recorded(self, channel: str) -> tuple[str, ...]:
        """The channels as recorded that this one is compared as: itself, or both sides of a
        difference.
        """

    @property
    def slipping(self) -> str:
        """The constant that changes the slip; "" where nothing slips."""

    @property
    def tabled(self) -> bool:
        """Whether the recordings are tables of steady states: their scatter was drawn, white, by
        what imported them.
        """

    @property
    def stated_noise(self) -> Mapping[str, float]:
        """Standard deviation of one reading of a channel as the configuration states it, in the
        channel's unit; of those that it states one.
        """

    @property
    def latencies(self) -> Sequence[Latency]:
        """How late each channel is beside the motion, told at the recordings' own rate."""

    @property
    def smooth(self) -> tuple[tuple[str, ...], ...]:
        """Covariates, alone or multiplied, on which a smooth misfit may depend."""

    @property
    def heated(self) -> tuple[str, ...]:
        """Channels that are read through the motor: only these may change as it warms up."""

    @property
    def motion_sigma(self) -> Sequence[Mapping[str, Array]]:
        """Per run, standard deviation (n,) of every channel's prediction by what is left open of
        the motion, in the channel's unit.
        """

    @property
    def unrest(self) -> Sequence[Sequence[Mapping[str, Array]]]:
        """Of each part that moves, per run, what every channel (n,) is predicted too low by if the
        unrest of its speed is noise of the sensor, in the channel's unit.
        """

    @property
    def reliefs(self) -> Sequence[Sequence[Mapping[str, Array]]]:
        """Of each wave of a surface that was prepared anew, per run what every channel (n,) reads
        of it, one standard deviation, in the channel's unit.
        """

    def predict(
        self, u: Array, effects: Sequence[Effect], everywhere: bool = False
    ) -> list[dict[str, Array]]:
        """Every channel of every run, for constants u (q,) in prior σ and effects beyond the
        baseline; everywhere: the effects act in the reference campaign too.
        """

    def aside(self) -> AbstractContextManager[None]:
        """What is predicted inside leaves no trace: predictions begin at earlier ones, so their
        last digits depend on what was predicted before.
        """

    def unit_factor(self, unit: str) -> float:
        """Factor from a parameter of the library in this unit to what it means for this rig."""

    def blur(self, stack: Stack, predicted: Array) -> Array:
        """Error (N,) of a prediction (N,) where it changes, by how motion and channels are
        averaged, in the channels' units.
        """

    @property
    def menu(self) -> Menu:
        """What may be driven next."""

    def foresee(self, experiment: str, u: Array, effects: Sequence[Effect]) -> Foreseen | None:
        """Every channel under an experiment, for constants u (q,) and effects; None where the rig
        cannot foresee it.
        """

    @property
    def law(self) -> LawForm | None:
        """How a misfit without a name is expressed; None where the rig has no such effect."""

    @property
    def shortcomings(self) -> Sequence[str]:
        """What these runs cannot show for want of a condition or a channel, a sentence each."""
