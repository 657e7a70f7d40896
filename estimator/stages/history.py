"""What depends on a whole run: derivatives, delays and things that remember. Arrays (n,) in order
of time.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import accumulate
from math import exp, log1p

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.terramechanics.soil import Array, Scalar

Bools = NDArray[np.bool_]

SMOOTHING = 0.2  # [s] span over which a measured speed or sinkage is averaged
LINEAR = 1e-8  # a share whose logarithm is linear


def smoothed(time: Scalar, value: Scalar, span: float = SMOOTHING) -> Array:
    """Moving average (n,) over `span` [s] of evenly sampled values (n,); it narrows at the ends."""
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
    """Time derivative (n,) [1/s] of a measured quantity (n,), smoothed over `span` [s]; 0 where
    there are not enough instants.
    """
    if np.ndim(value) == 0 or np.size(value) < 3:
        return np.zeros(np.shape(value))
    rate: Array = np.gradient(smoothed(time, value, span), time)
    return rate


def delayed(time: Scalar, value: Scalar, delay: float) -> Array:
    """The value (n,) `delay` [s] earlier, linear between samples, held before the first and after
    the last.
    """
    earlier: Array = np.interp(np.asarray(time) - delay, time, value)
    return earlier


def relaxed(time: Scalar, drive: Scalar, duration: float, run: Scalar = 0.0) -> Array:
    """y (n,) with duration [s] · dy/dt = drive − y and y = 0 where a run begins; exact for a drive
    constant between samples.
    """
    begins = run_begins(run, np.size(time))
    share = -np.expm1(-np.diff(time, prepend=np.ravel(time)[:1]) / duration)
    return _relax(np.where(begins, 0.0, drive), np.where(begins, 1.0, share))


def followed(target: Scalar, share: Array, run: Scalar = 0.0) -> Array:
    """y (…, n) that goes a share (n,) of the way to its target; a run begins at its target."""
    return _relax(np.asarray(target), np.where(run_begins(run, share.size), 1.0, share))


def turned_round(state: float, moved: float, exponent: float) -> float:
    """s, −1 … 1, after a step x, given over δ, of ds/dx = sign(dx) (1 − s sign(dx))^i: Dahl (1968).

    With u = 1 − s sign(dx), u^(1−i) falls by (1 − i) |x|; for i = 1 ln u falls by |x|. NaN where
    the step or the state is not known.
    """
    sign, rest = (1.0 if moved > 0.0 else -1.0), 1.0 - exponent
    left = 1.0 - state * sign
    if moved == 0.0 or left <= 0.0:
        return state

    fall = abs(moved) * left**-rest
    if rest * fall >= 1.0:  # it slips
        return sign
    log_left = log1p(-rest * fall) / rest if abs(rest * fall) >= LINEAR else -fall
    return sign * (1.0 - left * exp(log_left))


def presliding(path: Array, travel: float, exponent: float, start: float = 1.0) -> Array:
    """s (n,) of `turned_round` along a path (n,) [m], where δ is a travel [m]."""
    moved = (np.diff(path, prepend=path[:1]) / travel).tolist()
    turned = accumulate(moved, lambda s, x: turned_round(s, x, exponent), initial=start)
    return np.fromiter(turned, dtype=float)[1:]


def run_by_run(of: Callable[..., Array], run: Scalar, *along: Scalar) -> Array:
    """What `of` makes of the values (n,) of each run by itself, one run after the other (n,).

    run: the number of the run at each sample, or one number.
    """
    values = [np.atleast_1d(np.asarray(a, dtype=float)) for a in along]
    begins = np.flatnonzero(run_begins(run, values[0].size))
    if begins.size < 2:
        return of(*values)
    parts = zip(*(np.split(v, begins[1:]) for v in values), strict=True)
    return np.concatenate([of(*part) for part in parts])


def run_begins(run: Scalar, count: int) -> Bools:
    """Whether a run begins at a sample (n,)."""
    begins: Bools = np.zeros(count, bool)
    begins[:1] = True
    runs = np.asarray(run)
    if runs.size > 1:
        begins[1:] = runs[1:] != runs[:-1]
    return begins


def _relax(target: Array, share: Array) -> Array:
    """y_n = y_(n−1) + share_n (target_n − y_(n−1)) of targets (…, n) and shares (n,), all samples
    at once; the first share must be 1.

    Two steps are one step of the same form, so the reach of a step is doubled until it covers the
    run: Hillis and Steele (1986), Comm. ACM 29, 1170-1183.
    """
    kept, y = 1.0 - share, share * target
    reach = 1

    while reach < kept.size and kept.any():
        y[..., reach:] += kept[reach:] * y[..., :-reach]
        kept[reach:] = kept[reach:] * kept[:-reach]
        reach *= 2

    return y
