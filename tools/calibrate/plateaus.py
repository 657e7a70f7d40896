"""Where a sensor stands still: the stretches of a signal between changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.settings import Uncertain
from gritd.estimator.offline.windows import NORMAL, group_means
from gritd.estimator.terramechanics.soil import Array

BLOCK = 0.1  # [s] a signal is looked at in means over this time
STEP = 8.0  # [σ] of a block, beyond which the signal moves
LEAST = 1.0  # [s] of a plateau
EDGE = 0.2  # [s] left out at both ends
PARTS = 10  # of a plateau, whose means tell how uncertain its mean is


@dataclass(frozen=True)
class Plateau:
    """One stretch: begin and end [s], mean with the standard deviation of the mean, and how fast it
    creeps [1/s].
    """

    begin: float
    end: float
    mean: Uncertain
    creep: Uncertain


def mean_of(values: Array) -> Uncertain:
    """Mean of readings (n,), with its standard deviation from the means of PARTS, so that slow
    noise counts too.
    """
    if values.size < 2 * PARTS:
        sigma = float(values.std(ddof=1)) / np.sqrt(values.size) if values.size > 1 else 0.0
        return Uncertain(float(values.mean()), float(sigma))
    parts = np.array([part.mean() for part in np.array_split(values, PARTS)])
    single = float(values.std(ddof=1)) / np.sqrt(values.size)
    return Uncertain(float(values.mean()), max(float(parts.std(ddof=1)) / np.sqrt(PARTS), single))


def creep_of(seconds: Array, values: Array) -> Uncertain:
    """Slope of readings (n,) over time [1/s], with its standard deviation from the means of PARTS;
    infinite for few.
    """
    if values.size < 2 * PARTS or np.ptp(seconds) == 0.0:
        return Uncertain(0.0, float("inf"))
    time, mean = (
        np.array([part.mean() for part in np.array_split(one, PARTS)]) for one in (seconds, values)
    )
    time = time - time.mean()
    slope = float(time @ mean / (time @ time))
    left = mean - mean.mean() - slope * time
    scatter = float(np.sqrt(left @ left / (PARTS - 2)))
    return Uncertain(slope, scatter / float(np.sqrt(time @ time)))


def between(seconds: Array, values: Array, begin: float, end: float) -> Plateau | None:
    """The readings (n,) from `begin` to `end` [s]; None where there are fewer than ten."""
    inside = (seconds >= begin) & (seconds <= end)
    if inside.sum() < 10:
        return None
    return Plateau(begin, end, mean_of(values[inside]), creep_of(seconds[inside], values[inside]))


def plateaus(seconds: Array, values: Array) -> list[Plateau]:
    """The stretches of a second and more in which the signal does not change; arrays (n,)."""
    edges = np.arange(seconds[0], seconds[-1] + BLOCK, BLOCK)
    block = np.digitize(seconds, edges) - 1
    means, count = group_means(block, values, edges.size)
    filled = np.flatnonzero(count)
    if filled.size < LEAST / BLOCK:
        return []

    still = _still(means[filled])
    held = []
    for first, last in _stretches(still):
        begin, end = edges[filled[first]] + EDGE, edges[filled[last]] + BLOCK - EDGE
        if end - begin + 2.0 * EDGE >= LEAST and (one := between(seconds, values, begin, end)):
            held.append(one)
    return held


def _still(means: Array) -> NDArray[np.bool_]:
    """Which blocks differ from neither neighbour by more than noise."""
    steps = np.diff(means)
    noise = NORMAL * float(np.median(np.abs(steps))) / np.sqrt(2.0)
    limit = STEP * max(noise, 1e-3 * float(np.ptp(means)) / STEP, 1e-12)
    moves = np.abs(steps) > limit
    still: NDArray[np.bool_] = ~(np.append(moves, False) | np.insert(moves, 0, False))
    return still


def _stretches(
    still: NDArray[np.bool_],
) -> list[tuple[int, int]]:
    """First and last number of each run of True."""
    changes = np.flatnonzero(np.diff(np.concatenate(([False], still, [False])).astype(int)))
    return [(int(a), int(b) - 1) for a, b in changes.reshape(-1, 2)]
