"""What a run did, window by window, from its readings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import inf, isfinite, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.settings import UNMEASURED, Calibration, Channel, Settings
from gritd.estimator.messages.readings import ENCODERS, NS, WRENCH_FIELDS
from gritd.estimator.offline.windows import Bools, Ints, lines, members
from gritd.estimator.plausibility.clock import ReadingTimes, clock_of, wrap_of
from gritd.estimator.terramechanics.soil import Array
from gritd.estimator.wheel import window_choice
from gritd.estimator.wheel.window_choice import Cadence
from gritd.estimator.wheel.windows import STEP

MOVES = 4.0  # [σ] of its noise, a speed that is one …
SLOW = 0.1  # … and of the run's fastest: what is slower is a start or an end
LEAST = 5  # readings in a window
AT_MOST = 500_000  # readings of a channel that are looked at: bounds memory and time
FIRST = 0.4  # [s] windows in which speeds are looked at where their length is still to be chosen


class Raw(NamedTuple):
    """Readings of one channel: stamps (n,) [ns]; values (n,), of the wrench (n, 6), raw."""

    stamps: Ints
    values: NDArray[Any]


@dataclass(frozen=True)
class RunWindows:
    """Windows of a run, arrays (n,) in SI, NaN where nothing is known."""

    rim: Array  # rω [m/s]
    travel: Array  # v [m/s]
    sinkage: Array
    load: Array  # measured
    torque: Array  # at the axle
    pull: Array
    driving: Bools  # whether the wheel turns, at more than a start's speed

    @property
    def way(self) -> Array:
        """1 where the wheel turns forward (n,), -1 where it turns backward."""
        return np.sign(np.nan_to_num(self.rim))

    @property
    def count(self) -> int:
        return int(np.count_nonzero(self.driving))

    @property
    def slip(self) -> Array:
        """i of the driving windows (m,), along the way in which the wheel turns."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.travel[self.driving] / self.rim[self.driving]
            slip = np.where(ratio <= 1.0, 1.0 - ratio, 1.0 / ratio - 1.0)
        return np.clip(slip, -1.0, 1.0)


@dataclass(frozen=True)
class DrivenRun:
    """A run: its course, its clock and what is stated of it."""

    name: str
    course: RunWindows
    clock: ReadingTimes
    window: float  # [s] of the filter
    slip_sigma: float  # of slip in one window, by the noise of the encoders; inf for unknown
    stated_load: float | None  # [N]
    wrap: float = 0.0  # [rad] by which the wheel's angle falls back; 0 where it does not
    scatter: Mapping[str, float] = field(default_factory=dict)  # of one reading, by channel or axis


@np.errstate(all="ignore")  # numbers that are none stay none
def driven(
    name: str, raw: Mapping[str, Raw], settings: Settings, stated_load: float | None
) -> DrivenRun:
    """A run from the raw readings of its channels, each in the order of its stamps; some may be
    missing.
    """
    wheel = raw.get("wheel_encoder")
    if wheel is None or wheel.stamps.size < LEAST:
        nothing = RunWindows(*(np.zeros(0),) * 6, np.zeros(0, bool))
        return DrivenRun(name, nothing, ReadingTimes(0.0, 0.0, 0), 0.0, inf, stated_load)

    scale = settings.channels["wheel_encoder"].calibration.scale.value
    angle = wheel.values * scale
    clock = clock_of(wheel.stamps, angle)

    window = _length(raw, settings, clock.interval)
    course = course_of(raw, settings, window)
    cadences = _cadences(raw, settings)
    sigma = _slip_sigma(settings, course, cadences, window)
    scatter = dict(_scatter(raw, window, course.driving))
    return DrivenRun(name, course, clock, window, sigma, stated_load, wrap_of(angle), scatter)


def _length(raw: Mapping[str, Raw], settings: Settings, interval: float) -> float:
    """Of the filter's windows [s], or what five readings take, where these are longer."""
    rates = settings.rates
    least = LEAST * interval * 1.01
    if not rates.auto:
        return max(1.0 / rates.update, least)

    course = course_of(raw, settings, max(FIRST, least))
    speeds = _speeds(settings, course)
    cadences = _cadences(raw, settings)
    if not all(isfinite(v) and v != 0.0 for v in speeds) or len(cadences) < len(ENCODERS):
        return max(FIRST, least)
    return max(window_choice.chosen(settings, speeds, cadences) / NS, least)


def _speeds(settings: Settings, course: RunWindows) -> tuple[float, float]:
    """Usual speeds of wheel [rad/s] and carriage [m/s] while driving; NaN where there are none."""
    rim, travel = course.rim[course.driving], course.travel[course.driving]
    known = np.isfinite(travel)
    if not known.any():
        return nan, nan
    return abs(float(np.median(rim))) / settings.wheel.radius, abs(float(np.median(travel[known])))


def _cadences(raw: Mapping[str, Raw], settings: Settings) -> dict[str, Cadence]:
    return {
        name: Cadence(
            float(np.median(np.diff(raw[name].stamps))) / NS, settings.channels[name].noise
        )
        for name in ENCODERS
        if name in raw and raw[name].stamps.size > 1
    }


def _slip_sigma(
    settings: Settings, course: RunWindows, cadences: Mapping[str, Cadence], window: float
) -> float:
    speeds = _speeds(settings, course)
    if len(cadences) < len(ENCODERS) or not all(isfinite(v) and v > 0.0 for v in speeds):
        return inf
    return abs(window_choice.slip_sigma(settings, speeds, cadences, window))


# --- windows ---


def course_of(raw: Mapping[str, Raw], settings: Settings, window: float) -> RunWindows:
    """The windows of so many seconds in which the wheel was read."""
    after, until = _edges(raw["wheel_encoder"].stamps, round(window * NS))
    none = np.full(after.size, nan)
    rim, noise = _speed(raw, settings, "wheel_encoder", settings.wheel.radius, after, until)
    travel, _ = _speed(raw, settings, "carriage_encoder", settings.pulley_radius, after, until)

    def mean(name: str, values: Array | None = None) -> Array:
        if name not in raw:
            return none
        inside = members(raw[name].stamps, after, until)
        means = inside.mean(raw[name].values if values is None else values)
        return np.where(inside.size > 0, means, nan)

    channels, constant = settings.channels, settings.drive.torque_constant.value
    sinkage = _physical(mean("sinkage_pot"), channels.get("sinkage_pot"))
    current = _physical(mean("motor_shunt"), channels.get("motor_shunt"))
    axes = {axis: none for axis in ("fx", "fz", "ty")}
    if settings.wrench is not None and "wrench" in raw:
        given = (settings.wrench.drawbar_pull, settings.wrench.load, settings.wrench.torque)
        axes = {
            axis: _axis(raw["wrench"], axis, mean, calibration)
            for axis, calibration in zip(axes, given, strict=True)
        }

    torque = {"wrench": axes["ty"], "motor_shunt": current * constant}
    made = RunWindows(
        rim,
        travel,
        sinkage,
        axes["fz"],
        torque.get(settings.drive.torque_source, none),
        axes["fx"],
        np.zeros(after.size, bool),
    )
    return with_driving(made, noise)


def _scatter(raw: Mapping[str, Raw], window: float, driving: Bools) -> Iterator[tuple[str, float]]:
    """What one reading of each channel, of the wrench of each axis, scatters by [raw], as the
    filter's windows hear it: the median of the windows in which the wheel drives.
    """
    after, until = (
        edge[driving] for edge in _edges(raw["wheel_encoder"].stamps, round(window * NS))
    )
    for channel, (stamps, values) in raw.items():
        inside = members(stamps, after, until)
        columns = (
            dict(zip(WRENCH_FIELDS, values.T, strict=True))
            if channel == "wrench"
            else {channel: values}
        )
        for name, column in columns.items():
            of_each = (
                lines(inside, stamps, column, (after + until) // 2).left
                if channel in ENCODERS
                else STEP * inside.step(column)
            )
            told = of_each[inside.size >= LEAST]
            if told.size >= LEAST:
                yield name, float(np.median(told))


def with_driving(course: RunWindows, noise: Array) -> RunWindows:
    """With the windows marked in which the wheel drives; noise: of the rim's speed (n,) [m/s]."""
    speed = np.abs(np.nan_to_num(course.rim))
    fastest = float(np.percentile(speed, 95.0)) if speed.size else 0.0
    return replace(course, driving=(speed > MOVES * noise) & (speed > SLOW * fastest))


def _edges(stamps: Ints, length: int) -> tuple[Ints, Ints]:
    """Beginning and end (n,) [ns] of the windows side by side that hold readings; of a long run
    every so many, so that they hold AT_MOST readings.
    """
    number = np.unique((stamps - stamps[0]) // length)[:: stamps.size // AT_MOST + 1]
    after: Ints = stamps[0] + number * length - 1
    return after, after + length


def _speed(
    raw: Mapping[str, Raw], settings: Settings, name: str, arm: float, after: Ints, until: Ints
) -> tuple[Array, Array]:
    """Speed (n,) [m/s] of an encoder and its standard deviation (n,); NaN where a window holds too
    little.
    """
    none = np.full(after.size, nan)
    if name not in raw or name not in settings.channels:
        return none, none
    stamps, counts = raw[name]
    inside = members(stamps, after, until)
    line = lines(inside, stamps, counts, (after + until) // 2)
    span = stamps[inside.last] - stamps[inside.first]
    known = (inside.size >= 3) & (span >= (until - after) // 2)

    channel = settings.channels[name]
    scale = channel.calibration.scale.value * arm
    with np.errstate(divide="ignore", invalid="ignore"):
        noise = channel.noise * abs(scale) / line.spread
    return np.where(known, line.rate * scale, nan), np.where(known, noise, nan)


def _physical(means: Array, channel: Channel | None) -> Array:
    if channel is None:
        return np.full(means.size, nan)
    return means * channel.calibration.scale.value + channel.calibration.offset.value


def _axis(wrench: Raw, axis: str, mean: Any, calibration: Calibration) -> Array:
    """One axis of the wrench; NaN where it is not measured."""
    means: Array = mean("wrench", wrench.values[:, WRENCH_FIELDS.index(axis)])
    if calibration.offset.sigma >= UNMEASURED:
        return np.full(means.size, nan)
    return means * calibration.scale.value + calibration.offset.value
