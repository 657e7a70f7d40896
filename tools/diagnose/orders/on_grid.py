"""Ripples on a grid that is too coarse for them.

A value of the grid is a mean over an interval. It damps a fast ripple, and what is left is an
alias. So ripples that the readings show at their own rate are taken out of the readings before the
means are formed, and are put back as they stand at the middle of each interval: there the model is
evaluated. Vibrations above the grid's rate, and harmonics, which the library has no effect for, are
taken out alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.orders.lines import SpectralLine
from gritd.tools.diagnose.orders.stretches import (
    TURN,
    GridMotion,
    Ints,
    Series,
    nearest,
    steady_samples,
    stretches,
)
from gritd.tools.diagnose.orders.wave import pair
from gritd.tools.diagnose.tuning import TUNING


def on_grid(
    lines: Sequence[SpectralLine], motion: GridMotion, angle: Series, read: Series, middle: Array
) -> tuple[Series, Array]:
    """Readings of a channel less its lines, and what of them belongs to the grid (g,).

    lines: of this channel; angle: the wheel's [rad] as its encoder read it; read: times [s] and
    values (n,); middle: of the grid's intervals (g,) [s].
    """
    time, values = read
    restored = np.zeros(middle.size)
    wanted = [line for line in lines if line.axis == "angle" or beyond(line, motion.time)]
    begins, ends = stretches(motion)
    if not wanted or not begins.size:
        return read, restored

    inside, on_middle = _nearest(time, begins, ends, motion), _nearest(middle, begins, ends, motion)
    left = values
    for line in sorted(wanted, key=lambda x: -x.size):
        weights = _weights(line, motion, angle, (time, left), begins.size)
        left = left - _wave(line, angle, time, inside, weights)
        if line.axis == "angle" and not line.harmonic:
            restored += _wave(line, angle, middle, on_middle, weights)
    return (time, left), restored


def beyond(line: SpectralLine, grid: Array) -> bool:
    """Whether a line is faster than a grid of these times (g,) [s] holds."""
    rate = 1.0 / float(np.median(np.diff(grid)))
    return line.frequency[1] > TUNING.orders.nyquist * rate


def _weights(
    line: SpectralLine, motion: GridMotion, angle: Series, read: Series, count: int
) -> Array:
    """Cosine and sine (m, 2) of a line in each stretch; that of the run where a stretch holds too
    few cycles.
    """
    own = steady_samples(motion, angle, {line.channel: read}).get(line.channel)
    weights = np.zeros((count, 2))
    if own is None:
        return weights

    values = own.detrended(own.values)
    columns = own.detrended(pair(own.of(line.axis), line.at))
    weights[:] = np.linalg.lstsq(columns, values, rcond=None)[0]
    for part in own.slices:
        if line.at * float(np.ptp(own.of(line.axis)[part])) >= TUNING.orders.cycles:
            fitted = np.linalg.lstsq(columns[part], values[part], rcond=None)[0]
            weights[own.stretch[part.start]] = fitted
    return weights


def _nearest(time: Array, begins: Array, ends: Array, motion: GridMotion) -> Ints:
    """The stretch (n,) whose ripple a time (n,) [s] has, −1 where the wheel does not drive."""
    speed = np.abs(np.nan_to_num(motion.wheel_speed))
    driving = np.interp(time, motion.time, speed) > TUNING.rig.creep * np.median(speed[speed > 0])
    return np.where(driving, nearest(time, begins, ends), -1)


def _wave(line: SpectralLine, angle: Series, time: Array, stretch: Ints, weights: Array) -> Array:
    """(n,) at times (n,) [s], 0 where the wheel does not drive."""
    place = np.interp(time, *angle) / TURN if line.axis == "angle" else time
    waves = np.sum(pair(place, line.at) * weights[np.maximum(stretch, 0)], axis=1)
    return np.asarray(np.where(stretch >= 0, waves, 0.0))
