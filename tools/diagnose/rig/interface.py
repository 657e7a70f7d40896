"""What the engine needs of a rig: runs on a time grid, a prediction of the channels, what is known
of its constants.

A rig is one frozen value: `wheel_rig` makes it of a wheel in soil, `drive_rig` of a motor drive
without soil. The other rooms work on the arrays defined here and know a rig by this alone.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.settings import ConfiguredEffect
from gritd.estimator.effects.base import EXPERIMENTS, Effect
from gritd.estimator.model.discrepancy import Usual
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.orders.campaigns import NO_LINES, Lines

Bools = NDArray[np.bool_]
Index = NDArray[np.intp]
Channels = Mapping[str, Array]  # of one run (n,), each in its unit
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
        return min(max(self.value + u * self.sigma, self.low), self.high)

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
    """One run on the analysis grid; arrays (n,).

    used:   which values of a channel the comparison counts.
    idle:   1 where a torque is the motor's alone that else is a loss, else 0.
    turned: 1 where the wheel has turned back and not settled yet, else 0.
    """

    name: str
    time: Array  # [s] since the campaign began
    measured: Channels
    used: Mapping[str, Bools]
    covariates: Mapping[str, Array]
    idle: Array
    turned: Array


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
    said:      every experiment in words.
    """

    driven: tuple[str, ...]
    along: Mapping[str, str]
    otherwise: str
    said: Mapping[str, str] = field(default_factory=lambda: EXPERIMENTS)


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
    ways:       per run (n, 4), how far rim and axle have travelled where there is soil, in m and in
        usual contact lengths.
    signed:     whether its channels turn with the direction of travel.
    """

    name: str
    channels: tuple[str, ...]
    conditions: tuple[Array, ...]
    weight: tuple[Array, ...]
    size: float | None = None
    drive: bool = False
    usual: Usual | None = None
    ways: tuple[Array, ...] = ()
    signed: bool = True

    @property
    def count(self) -> int:
        """Conditions."""
        return int(self.conditions[0].shape[1])


@dataclass(frozen=True, eq=False)
class Held:
    """The learnt discrepancy that a configuration holds already: of each run its mean, and each
    direction that is left open of it, one standard deviation.
    """

    means: Sequence[Channels]
    doubts: Sequence[Sequence[Channels]]


def _nothing_foreseen(experiment: str, u: Array, effects: Sequence[Effect]) -> Foreseen:
    """Where the menu has nothing to drive."""
    raise KeyError(experiment)


Near = tuple[Array, Sequence[Effect]]  # constants (q,) and effects near by


class Predict(Protocol):
    """Every channel of every run."""

    def __call__(
        self,
        u: Array,
        effects: Sequence[Effect],
        in_both: Collection[str] = (),
        near: Near | None = None,
    ) -> list[dict[str, Array]]:
        """Channels (n,) for constants u (q,) in prior σ and effects beyond the baseline; in_both:
        names of those that act in the reference campaign too; near: constants and effects from
        whose balance that of these is looked for.
        """


@dataclass(frozen=True)
class RigWords:
    """What is said of a rig, and how.

    caveats:      what to know of the comparison, a sentence each.
    shortcomings: what these runs cannot show for want of a condition or a channel, likewise.
    menu:         what may be driven next.
    law:          how a misfit without a name is expressed; None where the rig has no such effect.
    """

    caveats: tuple[str, ...]
    menu: Menu
    shortcomings: tuple[str, ...] = ()
    law: LawForm | None = None


@dataclass(frozen=True, eq=False)
class Rig:
    """Recordings and what is known of the rig that they were made on.

    units:      of channels and covariates.
    effects:    the candidates.
    new:        of each run, whether candidates act; in all where there is no reference.
    foresee:    every channel under an experiment of the menu.
    having:     the rig with further effects in both campaigns, whose parameters are constants. A
        candidate of the same name is what is new of it.
    reference:  the rig with the runs of the reference alone; None where there is none.
    baseline:   effects of the configuration: the model has them already.
    smooth:     covariates, alone or multiplied, on which a smooth misfit may depend.
    heated:     channels that are read through the motor: only these change as it warms up.
    slipping:   the constant that changes the slip; "" where nothing slips.
    partial:    constants that do to some values, marked per run (n,), what another constant does to
        all: a cheap derivative.
    forms:      where the form of the model may be off; held: what the configuration holds of it.
    lines:      ripples that the recordings show at their own rate.
    loss_of_drive: whether channel torque is motor torque less axle torque.
    filtered:   whether prediction and recording go through the same filter, which blurs neither.
    tabled:     whether the recordings are tables of steady states, whose scatter was drawn, white,
        by what imported them.
    stated_noise: standard deviation of one reading of a channel as the configuration states it.
    unit_factors: from a parameter of the library in such a unit to what it means for this rig.
    motion_sigma: per run, standard deviation of a prediction by what is left open of the motion.
    named:      what the constants and offsets of a drive without soil amount to, each per run in
        every channel: what may be off without a name has no part in these.
    nuisances:  what every fit may be off by, each per run in every channel, one standard deviation:
        unrest of a speed that is noise of the sensor, waves of a bed that was prepared anew.
    """

    runs: Sequence[GridRun]
    channels: tuple[str, ...]
    units: Mapping[str, str]
    constants: tuple[Constant, ...]
    effects: Mapping[str, type[Effect]]
    new: Sequence[bool]
    predict: Predict
    words: RigWords
    smooth: tuple[tuple[str, ...], ...]
    heated: tuple[str, ...]
    foresee: Callable[[str, Array, Sequence[Effect]], Foreseen] = _nothing_foreseen
    having: Callable[[Sequence[ConfiguredEffect]], Rig] | None = None
    reference: Callable[[], Rig] | None = None
    baseline: tuple[Effect, ...] = ()
    slipping: str = ""
    partial: Mapping[str, tuple[str, Sequence[Bools]]] = field(default_factory=dict)
    forms: tuple[FormSource, ...] = ()
    held: Held | None = None
    lines: Lines = NO_LINES
    loss_of_drive: bool = False
    filtered: bool = False
    tabled: bool = False
    stated_noise: Mapping[str, float] = field(default_factory=dict)
    unit_factors: Mapping[str, float] = field(default_factory=dict)
    motion_sigma: Sequence[Channels] = ()
    named: Sequence[Sequence[Channels]] = ()
    nuisances: Sequence[Sequence[Channels]] = ()

    def recorded(self, channel: str) -> tuple[str, ...]:
        """The channels as recorded that this one is compared as: itself, or both sides of what the
        drive loses.
        """
        lost = self.loss_of_drive and channel == "torque"
        return ("torque", "axle_torque") if lost else (channel,)
