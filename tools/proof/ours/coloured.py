"""Noise of a colour, drawn."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_banded

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.noise.colour import Colour, step_of
from gritd.tools.diagnose.tuning import TUNING

WITHIN = 8  # readings of an interval whose mean is a value


def coloured(gaps: Array, count: int, colour: Colour, rng: np.random.Generator) -> Array:
    """Noise of a colour (n, count), in the unit of its σ; gaps (n,) between the values [s]."""
    white = 1.0 - colour.slow - colour.fast
    out = np.sqrt(white) * rng.standard_normal((len(gaps), count))
    for share, time, within in (
        (colour.slow, colour.time, WITHIN),
        (colour.fast, TUNING.noise.fast_time * step_of(gaps), 1),
    ):
        if share > 0.0:
            out += np.sqrt(share) * _relaxing(gaps, count, time, within, rng)
    return np.asarray(colour.sigma * out)


def _relaxing(gaps: Array, count: int, time: float, within: int, rng: np.random.Generator) -> Array:
    """Means of an Ornstein-Uhlenbeck process, of unit variance (n, count): of so many places within
    each interval of the regular grid, then where they are used.
    """
    step = step_of(gaps)
    between = 5 * (1 + round(time / step))  # grid places between runs: enough to forget
    place = np.cumsum(
        np.maximum(np.rint(np.where(np.isfinite(gaps), gaps / step, between)), 1.0)
    ).astype(int)

    kept = float(np.exp(-step / within / time))
    places = within * (int(place[-1]) + 1)
    kicks = rng.standard_normal((places, count)) * np.sqrt(1.0 - kept**2)
    means = _filtered(kicks, kept).reshape(-1, within, count).mean(axis=1)
    apart = np.abs(np.subtract.outer(np.arange(within), np.arange(within)))
    return np.asarray(means[place] / np.sqrt(np.mean(kept**apart)))


def _filtered(kicks: Array, kept: float) -> Array:
    """y (n, count) of yᵢ = kicksᵢ + kept · yᵢ₋₁. As scipy.signal's lfilter, which takes a second to
    load.
    """
    bands = np.stack((np.ones(len(kicks)), np.full(len(kicks), -kept)))
    return np.asarray(solve_banded((1, 0), bands, kicks, check_finite=False))
