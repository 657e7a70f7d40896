"""Where a wheel drives steadily, and what every channel read there at its own rate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter

from gritd.estimator.offline.windows import NORMAL
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SIZE, SPAN

TURN = 2.0 * np.pi  # [rad]
Ints = NDArray[np.int64]
Complexes = NDArray[np.complex128]
Series = tuple[Array, Array]  # times [s] in order, and values


@dataclass(frozen=True, eq=False)
class Samples:
    """Readings of one channel in one run while the wheel drives steadily; arrays (n,).

    angle: of the wheel [turns]; stretch: number of the steady stretch of each, ascending.
    """

    time: Array  # [s]
    angle: Array
    values: Array  # in the channel's unit
    stretch: Ints

    def of(self, axis: str) -> Array:
        """Place (n,) of each reading along an axis: turns, or seconds."""
        return self.angle if axis == "angle" else self.time

    def with_values(self, values: Array) -> Samples:
        """With other values (n,) at the same places."""
        other = replace(self, values=values)
        for name in ("slices", "trends"):  # are those of the places
            if name in self.__dict__:
                other.__dict__[name] = self.__dict__[name]
        return other

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """Of each stretch."""
        cuts = np.flatnonzero(np.diff(self.stretch)) + 1
        ends = [0, *cuts.tolist(), self.stretch.size]
        return tuple(slice(a, b) for a, b in pairwise(ends))

    def span(self, axis: str) -> float:
        """From the first reading to the last along an axis."""
        return max(float(np.ptp(self.of(axis))), SPAN)

    def longest(self, axis: str) -> float:
        """Of the stretches along an axis."""
        place = self.of(axis)
        return max(max(float(np.ptp(place[own])) for own in self.slices), SPAN)

    def parts(self) -> list[Samples]:
        """A long run cut into equal parts, each with a phase of its own: so long that no more
        frequencies are tried in time than orders against the angle.
        """
        orders = TUNING.orders.longest_part * TUNING.orders.highest_order
        turns = self.span("angle") * TUNING.orders.highest_order
        cycles = self.span("time") * TUNING.orders.highest_frequency
        count = int(np.ceil(max(turns, cycles) / orders))
        share = (self.time - self.time[0]) / self.span("time")
        number = np.minimum((count * share).astype(int), count - 1)
        return [self._some(number == k) for k in range(count) if np.sum(number == k) > 1]

    def _some(self, kept: NDArray[np.bool_]) -> Samples:
        return Samples(self.time[kept], self.angle[kept], self.values[kept], self.stretch[kept])

    @cached_property
    def trends(self) -> tuple[Array, ...]:
        """Orthonormal polynomials (n, t) of time in each stretch."""
        out = []
        for own in self.slices:
            time = self.time[own]
            x = 2.0 * (time - time[0]) / max(float(np.ptp(time)), SPAN) - 1.0
            degree = min(TUNING.orders.trend, x.size - 1)
            out.append(np.linalg.qr(np.polynomial.legendre.legvander(x, degree))[0])
        return tuple(out)

    def detrended(self, values: Array) -> Array:
        """Values (n, …) less the trend of each stretch."""
        out = np.array(values)
        for own, trend in zip(self.slices, self.trends, strict=True):
            out[own] -= trend @ (trend.T @ out[own])
        return out


@dataclass(frozen=True, eq=False)
class GridMotion:
    """How a run was driven, on any grid of times; arrays (n,), NaN where nothing is known."""

    time: Array  # [s]
    wheel_speed: Array  # [rad/s]
    carriage_speed: Array  # in any unit
    load: Array | None = None  # as measured, in any unit


def steady_samples(
    motion: GridMotion, angle: Series, channels: Mapping[str, Series], most: int | None = None
) -> dict[str, Samples]:
    """What each channel read in the steady stretches of a run.

    angle: the wheel's [rad] as its encoder read it; most: readings of a channel that are kept.
    Channels without a reading there are left out.
    """
    begins, ends = stretches(motion)
    out: dict[str, Samples] = {}
    if not begins.size:
        return out

    for name, (time, values) in channels.items():
        number = np.searchsorted(begins, time, side="right") - 1
        inside = (number >= 0) & (time < ends[np.maximum(number, 0)]) & np.isfinite(values)
        kept = np.flatnonzero(inside)[:most]
        if kept.size:
            turned = np.interp(time[kept], *angle) / TURN
            out[name] = Samples(time[kept], turned, values[kept], number[kept].astype(np.int64))
    return out


def stretches(motion: GridMotion) -> tuple[Array, Array]:
    """Beginnings and ends (m,) [s] of the stretches at steady speeds."""
    steady = _steady(motion)
    edges = np.diff(np.concatenate(([0], steady.astype(int), [0])))
    first, last = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0) - 1

    half = 0.5 * float(np.median(np.diff(motion.time))) if motion.time.size > 1 else 0.0
    begins, ends = motion.time[first] - half, motion.time[last] + half
    long = ends - begins >= TUNING.rig.hold
    return begins[long], ends[long]


def nearest(time: Array, begins: Array, ends: Array) -> Ints:
    """Number of the stretch (n,) that is nearest to each time (n,) [s]."""
    return np.searchsorted(0.5 * (ends[:-1] + begins[1:]), time).astype(np.int64)


def _steady(motion: GridMotion) -> NDArray[np.bool_]:
    """(n,) the wheel drives one way, settled, and neither a speed nor the load changes."""
    speed, step = motion.wheel_speed, float(np.median(np.diff(motion.time)))
    known = np.isfinite(speed) & np.isfinite(motion.carriage_speed)
    moving = np.abs(speed[known & (np.abs(speed) > 0.0)])
    usual = float(np.median(moving)) if moving.size else np.inf

    driving = known & (np.abs(speed) > TUNING.rig.creep * usual)
    way = np.where(driving, np.sign(np.nan_to_num(speed)), 0.0)
    turned = np.diff(way, prepend=way[:1]) != 0.0
    ramp = _changes(speed, step) | _changes(motion.carriage_speed, step)
    if motion.load is not None:
        ramp |= _changes(_without_pulses(motion.load, step), step)
    settling = round(TUNING.rig.settling / step)
    return np.asarray(driving & ~maximum_filter1d(turned, 2 * settling + 1) & ~ramp)


def _without_pulses(load: Array, step: float) -> Array:
    """A load (n,) whose steps stay and whose ripples and pulses are gone."""
    width = 2 * round(0.5 * TUNING.rig.hold / step) + 1
    return np.asarray(median_filter(np.nan_to_num(load), size=width, mode="nearest"))


def _changes(held: Array, step: float) -> NDArray[np.bool_]:
    """(n,) a speed or a load changes by more than its noise about here."""
    reach = max(round(TUNING.orders.apart / step), 1)
    known = np.nan_to_num(held)
    change = np.abs(known[2 * reach :] - known[: -2 * reach])
    whole = np.pad(change, reach)

    noise = NORMAL * float(np.median(change))
    usual = float(np.median(np.abs(known[known != 0.0]))) if np.any(known) else 0.0
    least = np.minimum(np.maximum(np.abs(known), usual), 2.0 * np.abs(known) + SIZE)
    threshold = np.maximum(TUNING.orders.changed * least, TUNING.orders.change_noise * noise)
    marked: NDArray[np.bool_] = whole > threshold
    return marked
