"""Waves in time, along the bed and along the way that the rim slides: where they are looked for,
and those that are no noise.

A wave in time has a phase of its own in every stretch of a run: pauses between runs are of any
length, and what shakes a testbed (a pump, a fan, footsteps, a controller that hunts) keeps its
period, not its phase. A wave of the bed or of the rails stays where it is: one phase for all runs,
or, where the bed was made anew, one for each. Soil that fails in bands swells and falls each time
the rim has slid by their distance: a wave along the way that it has slid, with a phase of its own
in every stretch. Whether a line stands out of the noise's spectrum is
decided as at the recordings' own rate (orders/lines.py).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.noise.saturated import Explainable, saturated_mean
from gritd.tools.diagnose.orders.lines import lines_along
from gritd.tools.diagnose.orders.stretches import Samples
from gritd.tools.diagnose.orders.wave import pair
from gritd.tools.diagnose.rig.interface import Index
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN

AXES = ("time", "position", "sliding")


def standing(stack: Stack, residual: Array, explainable: Explainable, cells: Index) -> Array:
    """Waves (N, m) in a residual (N,) that stand out of the noise's spectrum, whatever its colour;
    of noise alone none, so its size and colour stay what they are.

    Long waves of the bed, the same in all runs, have too few neighbours: they are left out of the
    noise whether they stand out or not, as lost freedom. explainable, cells: what else is no noise,
    left out first.
    """
    columns = [_long(stack, channel) for channel in stack.rig.channels]

    for channel in stack.rig.channels:
        own = np.flatnonzero(stack.of(channel))
        leading, whole = explainable.leading[own], explainable.whole[own]
        taken = saturated_mean(residual[own], leading, whole, cells[own])
        left = np.zeros(stack.size)
        left[own] = residual[own] - taken @ (taken.T @ residual[own])

        room = own.size // TUNING.noise.values_per_column
        phases = _phases(stack, channel)
        for axis, parts in phases:
            searches = len(phases) * len(stack.rig.channels)
            for pairs in _lines(stack, axis, parts, left, searches):
                room -= pairs.shape[1]
                if room >= 0:
                    columns.append(pairs)
    return np.column_stack(columns)


def axes_of(stack: Stack) -> list[str]:
    """Along which waves are looked for: a drive has no soil to slide over."""
    return [axis for axis in AXES if axis in stack.rig.runs[0].covariates]


def stretches(stack: Stack, channel: str) -> list[Index]:
    """Places (n,) of a channel's values in one run while the wheel moves, long runs cut into equal
    parts.
    """
    own = stack.of(channel) & (stack.covariate("speed") > 0.0)
    parts: list[Index] = []

    for number in range(len(stack.rig.runs)):
        index = np.flatnonzero(own & (stack.run == number))
        if index.size:
            since = stack.time[index] - stack.time[index[0]]
            count = int(np.ceil(max(float(since[-1]), SPAN) / TUNING.noise.stretch))
            ends = np.searchsorted(since, since[-1] * np.arange(1, count) / count)
            parts += [np.asarray(part, dtype=np.intp) for part in np.split(index, ends)]

    return [index for index in parts if index.size >= TUNING.noise.cell_values]


def frequencies(stack: Stack, channel: str, axis: str) -> Array:
    """Waves [1/s, 1/m] that the grid shows (f,): some cycles in the longest stretch at least; empty
    where there is none.
    """
    x, parts = stack.covariate(axis), stretches(stack, channel)
    longest = max((float(np.ptp(x[index])) for index in parts), default=0.0)
    if longest <= SPAN:
        return np.zeros(0)

    interval = float(np.median(np.concatenate([np.abs(np.diff(x[index])) for index in parts])))
    span = longest if axis != "position" else float(np.ptp(x[np.concatenate(parts)]))
    every = np.arange(TUNING.noise.most_frequencies) / (TUNING.noise.line_density * span)
    tried = TUNING.orders.cycles / longest + every
    return np.asarray(tried[tried * interval < TUNING.orders.nyquist])


def neighbours(x: Array, parts: list[Index], tried: Array) -> Array:
    """(f, f) 1 where one frequency is a neighbour of the other: its spectrum near by, but not it
    itself.
    """
    longest = max(float(np.ptp(x[index])) for index in parts)
    apart = np.abs(tried[:, None] - tried) * longest
    return ((apart >= TUNING.orders.near) & (apart <= TUNING.orders.far)).astype(float)


def _phases(stack: Stack, channel: str) -> list[tuple[str, list[Index]]]:
    """Axes, and the values that share a phase."""
    parts = stretches(stack, channel)
    if not parts:
        return []
    shared = [("position", [np.concatenate(parts)])] if len(parts) > 1 else []
    own = [(axis, parts) for axis in axes_of(stack)]
    return [*own[:1], *shared, *own[1:]]


def _lines(
    stack: Stack, axis: str, parts: list[Index], left: Array, searches: int
) -> Iterator[Array]:
    """Columns of one line after the other; `left` (N,) loses them."""
    x = stack.covariate(axis)
    samples = [Samples(x[i], x[i], left[i], np.zeros(i.size, np.int64)) for i in parts]
    if max(float(np.ptp(part.time)) for part in samples) <= SPAN:
        return

    for at in lines_along(samples, searches):
        out = np.zeros((x.size, 2 * len(parts)))
        for number, index in enumerate(parts):
            wave = pair(x[index], at)
            out[index, 2 * number : 2 * number + 2] = wave
            left[index] -= wave @ np.linalg.lstsq(wave, left[index], rcond=None)[0]
        yield out


def _long(stack: Stack, channel: str) -> Array:
    """Waves along the bed (N, m), one phase for all runs, too long to have neighbours; of a single
    run none.
    """
    parts, tried = stretches(stack, channel), frequencies(stack, channel, "position")
    if len(parts) < 2 or not tried.size:
        return np.zeros((stack.size, 0))

    index, x = np.concatenate(parts), stack.covariate("position")
    longest = max(float(np.ptp(x[part])) for part in parts)
    beyond = (TUNING.orders.cycles + TUNING.orders.near + 1.0) / longest
    most = 1 + int(TUNING.noise.line_density * (TUNING.orders.near + 1.0))
    shapes = pair(x[index], tried[tried < beyond][:most])
    out = np.zeros((stack.size, 2 * shapes.shape[1]))
    out[index] = shapes.reshape(index.size, -1)
    return out
