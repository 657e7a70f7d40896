"""Waves in time and along the bed: where they are looked for, and those that stand out of the
noise's spectrum.

A wave in time has a phase of its own in every stretch of a run: pauses between runs are of any
length, and what shakes a testbed (a pump, a fan, footsteps, a controller that hunts) keeps its
period, not its phase. A wave of the bed or of the rails stays where it is: one phase for all runs,
or, where the bed was made anew, one for each.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import fdtrc

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.noise.saturated import Explainable, saturated_mean
from gritd.tools.diagnose.rig.interface import Index
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN, SQUARE

AXES = ("time", "position")


def stretches(stack: Stack, channel: str) -> list[Index]:
    """Places (n,) of a channel's values in one run while the wheel moves, long runs cut into equal
    parts.
    """
    own = stack.of(channel) & (stack.covariate("speed") > 0.0)
    parts: list[Index] = []

    for number in range(len(stack.rig.runs)):
        index = np.flatnonzero(own & (stack.run == number))
        if index.size:
            time = stack.time[index]
            count = int(np.ceil(max(float(np.ptp(time)), SPAN) / TUNING.noise.stretch))
            parts += [index[part == k] for part in [_parts(time, count)] for k in range(count)]

    return [index for index in parts if index.size >= TUNING.noise.stretch_values]


def _parts(time: Array, count: int) -> Index:
    share = (time - time[0]) / max(float(np.ptp(time)), SPAN)
    return np.asarray(np.minimum((count * share).astype(int), count - 1), dtype=np.intp)


def frequencies(stack: Stack, channel: str, axis: str) -> Array:
    """Waves [1/s, 1/m] that the grid shows (f,): at least CYCLES in the longest stretch; empty
    where there is none.
    """
    x, parts = stack.covariate(axis), stretches(stack, channel)
    longest = max((float(np.ptp(x[index])) for index in parts), default=0.0)
    if longest <= SPAN:
        return np.zeros(0)

    along = np.concatenate(parts)
    interval = float(np.median(np.concatenate([np.abs(np.diff(x[index])) for index in parts])))
    span = longest if axis == "time" else float(np.ptp(x[along]))
    low, high = (
        TUNING.noise.cycles / longest,
        TUNING.noise.line_nyquist / max(interval, TUNING.noise.least_interval * longest),
    )

    tried = np.arange(low, high, 1.0 / (TUNING.noise.line_density * span))
    return np.asarray(tried[: TUNING.noise.most_frequencies])


def waves(x: Array, frequency: Array) -> Array:
    """Cosines and sines (n, f, 2)."""
    phase = 2.0 * np.pi * np.multiply.outer(x, frequency)
    return np.stack((np.cos(phase), np.sin(phase)), axis=-1)


def standing(stack: Stack, residual: Array, explainable: Explainable, cells: Index) -> Array:
    """Waves (N, m) in a residual (N,) that stand out of their neighbours, whatever the colour of
    the noise.

    Noise has a smooth spectrum. A line of more power than that of its neighbours by a factor that
    chance gives one channel in a hundred is none, and is not taken for it; of noise alone nothing
    is taken, so its size and colour stay what they are. Long waves of the bed, the same in all
    runs, have too few neighbours: they are left out of the noise whether they stand out or not, as
    lost freedom. explainable, cells: what else is no noise, left out first.
    """
    columns = [_long(stack, channel) for channel in stack.rig.channels]

    for channel in stack.rig.channels:
        own = np.flatnonzero(stack.of(channel))
        leading, whole = explainable.leading[own], explainable.whole[own]
        taken = saturated_mean(residual[own], leading, whole, cells[own])
        left = np.zeros(stack.size)
        left[own] = residual[own] - taken @ (taken.T @ residual[own])

        room = own.size // TUNING.noise.values_per_line
        for axis, parts in _phases(stack, channel):
            for pairs in _lines(
                stack.covariate(axis), frequencies(stack, channel, axis), parts, left
            ):
                room -= pairs.shape[1]
                if room >= 0:
                    columns.append(pairs)
    return np.column_stack(columns)


def _long(stack: Stack, channel: str) -> Array:
    """Waves along the bed (N, m), one phase for all runs, too long to have neighbours; of a single
    run none.
    """
    parts, tried = stretches(stack, channel), frequencies(stack, channel, "position")
    if len(parts) < 2 or not tried.size:
        return np.zeros((stack.size, 0))

    index, x = np.concatenate(parts), stack.covariate("position")
    longest = max(float(np.ptp(x[part])) for part in parts)

    shapes = waves(
        x[index],
        tried[tried < (TUNING.noise.cycles + TUNING.noise.near_line + 1.0) / longest][
            : TUNING.noise.long_waves
        ],
    )
    out = np.zeros((stack.size, 2 * shapes.shape[1]))
    out[index] = shapes.reshape(index.size, -1)
    return out


def _phases(stack: Stack, channel: str) -> Iterator[tuple[str, list[Index]]]:
    """Axes, and the values that share a phase."""
    parts = stretches(stack, channel)
    yield "time", parts
    if len(parts) > 1:
        yield "position", [np.concatenate(parts)]
    yield "position", parts


def _lines(x: Array, tried: Array, parts: list[Index], left: Array) -> Iterator[Array]:
    """Columns of one line after the other; `left` (N,) loses them."""
    if tried.size < 2 * TUNING.noise.far_line:
        return

    shapes, near = [waves(x[index], tried) for index in parts], neighbours(x, parts, tried)
    for _ in range(TUNING.noise.strongest_lines):
        power = sum(_power(shape, left[index]) for shape, index in zip(shapes, parts, strict=True))
        chance = _chance(np.asarray(power), len(parts), near)
        best = int(np.argmin(chance))
        if chance[best] * tried.size > TUNING.noise.line_chance:
            return

        out = np.zeros((x.size, 2 * len(parts)))
        for number, (shape, index) in enumerate(zip(shapes, parts, strict=True)):
            pair = shape[:, best]
            out[index, 2 * number : 2 * number + 2] = pair
            left[index] -= pair @ np.linalg.lstsq(pair, left[index], rcond=None)[0]
        yield out


def _power(shape: Array, values: Array) -> Array:
    """Squares (f,) that cosine and sine take of values (n,)."""
    return np.asarray(np.sum(np.tensordot(values, shape, 1) ** 2, axis=-1) * 2.0 / len(values))


def neighbours(x: Array, parts: list[Index], tried: Array) -> Array:
    """(f, f) 1 where one frequency is a neighbour of the other: its spectrum near by, but not it
    itself.
    """
    longest = max(float(np.ptp(x[index])) for index in parts)
    apart = np.abs(tried[:, None] - tried) * longest
    return ((apart >= TUNING.noise.near_line) & (apart <= TUNING.noise.far_line)).astype(float)


def _chance(power: Array, parts: int, near: Array) -> Array:
    """Chance (f,) of a power beside the mean of its neighbours on either side, for noise of a
    smooth spectrum.

    All are sums of squares, the neighbours' of as many as they resolve. The side that holds more
    counts: the spectrum of slow noise falls steeply. Without neighbours on both sides nothing is
    known.
    """
    out = np.zeros(power.size)

    for side in (np.tril(near), np.triu(near)):
        count = side.sum(axis=1)
        freedom = 2.0 * parts * np.maximum(count / TUNING.noise.line_density, 1.0)
        beside = fdtrc(2.0 * parts, freedom, power * count / np.maximum(side @ power, SQUARE))
        out = np.maximum(out, np.where(count > TUNING.noise.line_density, beside, 1.0))

    return out
