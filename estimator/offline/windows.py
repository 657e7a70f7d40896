"""Readings to means and slopes over windows, from arrays: the one place where that is done
offline.

Two kinds of windows. `Members` are windows that may overlap, each with a beginning and an end of
its own: what a tick looks back on. Blocks lie side by side between `edges`: a grid for a whole
recording. On line `wheel/windows.py` makes the same means and slopes as `Members`, one reading
after another.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from gritd.estimator.messages.readings import NS
from gritd.estimator.terramechanics.soil import Array
from gritd.estimator.wheel.windows import LOUDER, SCATTERED

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LEAST = 0.3  # share of the usual number of readings below which a block is not used
OUTLIER = 6.0  # [σ] from the block's median and from its neighbours': such a reading is left out
BESIDE = 5  # readings whose median is its neighbours'
QUICK, STEADY, LONG = 1, 4, 12  # blocks to either side over which a slope is fitted
GROWN = 1.2  # what the longest line may leave, in what short ones leave
CALM = 4.0  # [σ] within which the two slopes are the same
NORMAL = 1.4826  # standard deviation of normal scatter over its median absolute deviation


# ---- windows that may overlap --------------------------------------------------------------------


class Members(NamedTuple):
    """Which readings of a channel lie in which window: n readings, m windows, p memberships."""

    reading: Ints  # (p,) numbers of the readings inside, window after window
    window: Ints  # (p,) and of the window each is in
    size: Ints  # (m,) readings in each window
    first: Ints  # (m,) number of the first of them
    last: Ints  # (m,) and of the last

    def sum(self, values: Array) -> Array:
        """Sums over each window (m,) of values (p,)."""
        return _sums(self.window, values, len(self.size))

    def mean(self, values: NDArray[Any]) -> Array:
        """Means over each window (m,) of the readings' values (n,); 0 in an empty one."""
        mean: Array = self.sum(values[self.reading]) / np.maximum(self.size, 1)
        return mean

    def step(self, values: Array) -> Array:
        """Median (m,) of the steps between the readings' values (n,); 0 without any."""
        inside = values[self.reading]
        within = np.diff(self.window, prepend=-1) == 0
        steps = np.abs(np.diff(inside, prepend=0.0))[within]
        ordered = steps[np.lexsort((steps, self.window[within]))]
        ends = np.cumsum(np.maximum(self.size - 1, 0))
        count = np.diff(ends, prepend=0)
        middle = ends - count + count // 2, ends - 1 - count // 2
        ordered = np.append(ordered, 0.0)  # windows without a step
        low, high = (ordered[np.clip(at, 0, len(steps))] for at in middle)
        return np.where(count > 0, 0.5 * (low + high), 0.0)

    def heard(self, scatter: Array, stated: float) -> Array:
        """σ of one reading in each window (m,), by what they scatter by (m,); see
        wheel.windows.heard.
        """
        least = stated * (1.0 + LOUDER / np.sqrt(np.maximum(self.size, 1)))
        return np.where((self.size >= SCATTERED) & (scatter > least), scatter, stated)

    def hold_two(self, values: NDArray[Any]) -> Bools:
        """Whether each window (m,) holds one or two different values of the readings' (n,)."""
        inside = values[self.reading]
        least, most = np.full(len(self.size), np.inf), np.full(len(self.size), -np.inf)
        np.minimum.at(least, self.window, inside)
        np.maximum.at(most, self.window, inside)
        between = (inside > least[self.window]) & (inside < most[self.window])
        held: Bools = (self.size > 0) & (self.sum(between.astype(float)) == 0.0)
        return held


def members(stamp: Ints, after: Ints, until: Ints) -> Members:
    """The readings of each window: after < stamp ≤ until.

    stamp (n,) [ns], ascending, n ≥ 1; after, until (m,) [ns].
    """
    low, high = np.searchsorted(stamp, after, "right"), np.searchsorted(stamp, until, "right")
    size = high - low
    window = np.repeat(np.arange(len(size)), size)
    reading = np.arange(len(window)) + (low - np.cumsum(size) + size)[window]
    return Members(reading, window, size, np.minimum(low, len(stamp) - 1), np.maximum(high - 1, 0))


class WindowLines(NamedTuple):
    """A least-squares line through the counts of each window; without meaning below two
    readings.
    """

    middle: Array  # (m,) [raw] at the centre of each window
    rate: Array  # (m,) [raw/s]
    spread: Array  # (m,) √Σ(t − t̄)² [s]
    moved: Array  # (m,) counts from the first reading to the last [raw]
    left: Array  # (m,) what the readings scatter by about the line [raw]


def lines(members: Members, stamp: Ints, counts: Ints, centres: Ints) -> WindowLines:
    """Lines through the counts (n,) at the stamps (n,) [ns] in windows about `centres` (m,) [ns];
    see wheel.windows.SlopeWindow.
    """
    reading, window = members.reading, members.window
    origin, begun = counts[members.first], stamp[members.first]
    size = np.maximum(members.size, 1)
    t = (stamp[reading] - begun[window]).astype(float)
    x = (counts[reading] - origin[window]).astype(float)

    mean = members.sum(x) / size
    at = members.sum(t) / size
    t -= at[window]
    spread = members.sum(t * t)
    with np.errstate(divide="ignore", invalid="ignore"):  # a window of one reading has no slope
        along = members.sum(t * (x - mean[window]))
        rate = along / spread * NS
        squares = members.sum((x - mean[window]) ** 2) - along * along / spread

    moved = np.abs(counts[members.last] - origin).astype(float)
    middle = origin + mean + rate * ((centres - begun) - at) / NS
    left = np.sqrt(np.maximum(squares, 0.0) / np.maximum(size - 2, 1))
    return WindowLines(middle, rate, np.sqrt(spread) / NS, moved, left)


# ---- blocks side by side -------------------------------------------------------------------------


class Slopes(NamedTuple):
    """A quantity on a grid of n blocks, NaN where too few readings tell."""

    value: Array  # (n,) at the middle of each block
    rate: Array  # (n,) [1/s]
    sigma: Array  # (n,) standard deviation of the rate


def group_means(group: Ints, values: Array, n: int) -> tuple[Array, Ints]:
    """Mean (n,) of the values (m,) of each group, NaN in an empty one, and how many there are (n,).

    group: number of each value's group (m,), 0 … n − 1.
    """
    count = np.bincount(group, minlength=n)
    means = _sums(group, values, n) / np.maximum(count, 1)
    return np.where(count > 0, means, np.nan), count


def block_mean(time: Array, values: Array, edges: Array) -> Array:
    """Mean of the readings in each block (n,), moved to its middle; NaN in one with too few.

    time [s], values (m,) in order of time; edges (n + 1,) [s]. Single readings far off both the
    block's median and their neighbours are left out: a step within a block is none.
    """
    n, middle = edges.size - 1, 0.5 * (edges[1:] + edges[:-1])
    block, (time, values) = _in_blocks(edges, time, time, values)

    off = np.abs(values - _median(block, values, n)[block])
    scale = NORMAL * np.median(off) if off.size else 0.0
    near = np.abs(values - _running_median(values)) if off.size else off
    kept = np.minimum(off, near) <= (OUTLIER * scale if scale > 0.0 else np.inf)
    block, time, values = block[kept], time[kept], values[kept]

    mean, count = group_means(block, values, n)
    at, _ = group_means(block, time, n)

    usual = np.median(count[count > 0]) if (count > 0).any() else 1.0
    enough = count >= LEAST * usual
    centred = np.full(n, np.nan)
    if np.count_nonzero(enough) > 1:
        rate = np.gradient(mean[enough], at[enough])
        centred[enough] = mean[enough] + rate * (middle - at)[enough]
    return centred


def block_slope(time: Array, values: Array, edges: Array, quick: int = QUICK) -> Slopes:
    """Value and slope of an encoder at the middle of each block (n,).

    time [s], values (m,) in order of time; edges (n + 1,) [s]. By a line fitted over the block and
    its neighbours, `quick` to either side; where the slope is steady within its own noise, STEADY
    or LONG to either side, if that line leaves no more than the short one: at creeping speed one
    count is much of the slip, and counts that beat with the sampling make slow waves of what was
    steady.
    """
    best, left = _block_lines(time, values, edges, quick)
    short, calm = best.rate, np.ones(best.rate.size, bool)
    for reach in (STEADY, LONG):
        far, more = _block_lines(time, values, edges, reach)
        off = np.abs(np.nan_to_num(short - far.rate))
        usual = np.median(_neighbours(left, reach), axis=1)
        same = (off <= CALM * NORMAL * np.median(off)) & (
            (reach == STEADY) | (more <= GROWN * usual)
        )
        calm = calm & _neighbours(same, reach).all(axis=1) & np.isfinite(far.rate)
        best = Slopes(*(np.where(calm, one, other) for one, other in zip(far, best, strict=True)))

    return best


def block_bend(time: Array, values: Array, edges: Array) -> Array:
    """Mean second derivative (n,) [1/s²] of an encoder over each block; NaN where too few readings
    tell.

    time [s], values (m,) in order of time; edges (n + 1,) [s]. The slope at the block's end less
    that at its beginning, each by a line over half a block to either side, longer where the slope
    is steady: what changes within a block or two is smeared over no more.
    """
    middle, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    about = np.concatenate(([middle[0] - width[0]], middle, [middle[-1] + width[-1]]))
    bend: Array = np.diff(block_slope(time, values, about, quick=0).rate) / width
    return bend


def _block_lines(time: Array, values: Array, edges: Array, reach: int) -> tuple[Slopes, Array]:
    """Lines fitted over each block and `reach` more on either side; the r.m.s. of what they
    leave (n,).
    """
    n, middle = edges.size - 1, 0.5 * (edges[1:] + edges[:-1]) - edges[0]
    block, (t, y) = _in_blocks(edges, time, time - edges[0], values)
    y = y - (first := y[0] if y.size else 0.0)

    weights = (np.ones(t.size), t, t * t, y, t * y, y * y)
    s0, s1, s2, y0, y1, y2 = (_joined(_sums(block, w, n), reach) for w in weights)
    with np.errstate(invalid="ignore", divide="ignore"):
        spread = s2 - s1 * s1 / s0
        rate = (y1 - s1 * y0 / s0) / spread
        at = first + y0 / s0 + rate * (middle - s1 / s0)
        left = np.sqrt(np.maximum(y2 - y0 * y0 / s0 - rate * (y1 - s1 * y0 / s0), 0.0) / s0)
        scatter = left / np.sqrt(spread)

    enough = (s0 > 1.0) & (s0 >= LEAST * np.median(s0))  # one reading has no slope
    columns = (np.where(enough, x, np.nan) for x in (at, rate, scatter))
    return Slopes(*columns), np.where(enough, left, 0.0)


def _in_blocks(edges: Array, time: Array, *columns: Array) -> tuple[Ints, list[Array]]:
    """The block of each reading that lies in one, and those readings' columns."""
    block = np.searchsorted(edges, time, side="right") - 1
    inside = (block >= 0) & (block < edges.size - 1)
    return block[inside], [column[inside] for column in columns]


def _sums(group: Ints, values: Array, n: int) -> Array:
    """Sums (n,) of the values (m,) of each group."""
    return np.bincount(group, values, n).astype(float)


def _median(block: Ints, values: Array, n: int) -> Array:
    """Median of each block (n,); 0 where it is empty."""
    order = np.lexsort((values, block))
    count = np.bincount(block, minlength=n)
    middle = np.cumsum(count) - count + count // 2
    return np.where(count > 0, values[order[np.minimum(middle, max(values.size - 1, 0))]], 0.0)


def _running_median(values: Array) -> Array:
    """Median (n,) of each value and its neighbours, BESIDE together."""
    padded = np.pad(values, BESIDE // 2, mode="edge")
    return np.asarray(np.median(sliding_window_view(padded, BESIDE), axis=1))


def _joined(sums: Array, most: int) -> Array:
    """Sums over a block and `most` neighbours on either side; fewer at the ends."""
    total = np.concatenate(([0.0], np.cumsum(sums)))
    at = np.arange(sums.size)
    reach = np.minimum(np.minimum(at, at[::-1]), most)
    joined: Array = total[at + reach + 1] - total[at - reach]
    return joined


def _neighbours(values: NDArray[Any], reach: int) -> NDArray[Any]:
    """(n, 2 reach + 1): each of the values (n,) with its neighbours; the ends are repeated."""
    return sliding_window_view(np.pad(values, reach, mode="edge"), 2 * reach + 1)
