"""Noise of a colour, drawn."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_banded

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.noise.colour import Colour, step_of
from gritd.tools.diagnose.tuning import TUNING


def coloured(gaps: Array, count: int, colour: Colour, rng: np.random.Generator) -> Array:
    """Noise of a colour (n, count), in the unit of its σ; gaps (n,) between the values [s]."""
    white = 1.0 - colour.slow - colour.fast
    out = np.sqrt(white) * rng.standard_normal((len(gaps), count))
    for share, time in (
        (colour.slow, colour.time),
        (colour.fast, TUNING.noise.fast_time * step_of(gaps)),
    ):
        if share > 0.0:
            out += np.sqrt(share) * _relaxing(gaps, count, time, rng)
    return np.asarray(colour.sigma * out)


def _relaxing(gaps: Array, count: int, time: float, rng: np.random.Generator) -> Array:
    """An Ornstein-Uhlenbeck process of unit variance (n, count): on the regular grid, then where it
    is used.
    """
    step = step_of(gaps)
    apart = 5 * (1 + round(time / step))  # grid places between runs: enough to forget
    place = np.cumsum(
        np.maximum(np.rint(np.where(np.isfinite(gaps), gaps / step, apart)), 1.0)
    ).astype(int)

    kept = float(np.exp(-step / time))
    kicks = rng.standard_normal((int(place[-1]) + 1, count)) * np.sqrt(1.0 - kept**2)
    return np.asarray(_filtered(kicks, kept)[place])


def _filtered(kicks: Array, kept: float) -> Array:
    """y (n, count) of yᵢ = kicksᵢ + kept · yᵢ₋₁. As scipy.signal's lfilter, which takes a second to
    load.
    """
    bands = np.stack((np.ones(len(kicks)), np.full(len(kicks), -kept)))
    return np.asarray(solve_banded((1, 0), bands, kicks, check_finite=False))
