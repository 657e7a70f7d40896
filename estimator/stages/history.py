"""What depends on a whole run: derivatives, delays and things that remember. Arrays (n,) in order
of time.
"""

from __future__ import annotations

from itertools import accumulate

import numpy as np

from gritd.estimator.terramechanics.soil import Array, Scalar

SMOOTHING = 0.2  # [s] span over which a measured speed or sinkage is averaged


def smoothed(time: Scalar, value: Scalar, span: float = SMOOTHING) -> Array:
    """Moving average over `span` [s] of evenly sampled values; towards the ends the window narrows."""
    time, value = np.asarray(time, dtype=float), np.asarray(value, dtype=float)
    if value.ndim == 0:
        return value
    half = min(
        round(0.5 * span * (time.size - 1) / max(time[-1] - time[0], 1e-9)), (value.size - 1) // 2
    )
    at = np.arange(value.size)
    reach = np.minimum(np.minimum(at, at[::-1]), half)
    total = np.concatenate(([0.0], np.cumsum(value - value[0])))
    mean: Array = (total[at + reach + 1] - total[at - reach]) / (2 * reach + 1) + value[0]
    return mean


def rate_of(time: Scalar, value: Scalar, span: float = SMOOTHING) -> Array:
    """Time derivative of a measured quantity, smoothed over `span` [s]; 0 where there are not
    enough instants.
    """
    if np.ndim(value) == 0 or np.size(value) < 3:
        return np.zeros(np.shape(value))
    rate: Array = np.gradient(smoothed(time, value, span), time)
    return rate


def delayed(time: Scalar, value: Scalar, delay: float) -> Scalar:
    """The value `delay` [s] earlier, linear between samples, held before the first and after the
    last.
    """
    if delay == 0.0 or np.ndim(value) == 0:
        return value
    return np.interp(np.asarray(time) - delay, time, value)


def relaxed(time: Scalar, drive: Scalar, duration: float) -> Array:
    """y with duration · dy/dt = drive − y and y = 0 at the start; exact for a drive constant
    between samples.
    """
    return _relax(drive, -np.expm1(-np.diff(time, prepend=np.ravel(time)[:1]) / duration), 0.0)


def path_relaxed(path: Scalar, length: float, start: float = 1.0) -> Array:
    """y with length · dy/ds = sign(dx) − y along the path length s of x."""
    moved = np.diff(path, prepend=np.ravel(path)[:1])
    return _relax(np.sign(moved), -np.expm1(-np.abs(moved) / length), start)


def _relax(target: Scalar, gain: Array, start: float) -> Array:
    """y moves towards its target by a share `gain` of the way, sample by sample."""
    steps = zip(np.broadcast_to(target, gain.shape).tolist(), gain.tolist(), strict=True)
    values = accumulate(steps, lambda y, step: y + step[1] * (step[0] - y), initial=start)
    return np.fromiter(values, dtype=float)[1:]
