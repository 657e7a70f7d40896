"""Long curves in few points: the least and the greatest of every stretch are kept."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.terramechanics.soil import Array


def envelope(
    time: Array, values: Array, span: tuple[float, float], points: int
) -> tuple[Array, Array]:
    """Of curves time (n,) ascending, values (n, m): at most `points` of the span, times (p,) and
    values (p, m).

    Where there are more, the span is cut into points/2 stretches of equal length. Of each and each
    column come least and greatest, the one first that the curve goes away from. A stretch without
    a sample gives NaN.
    """
    first, last = np.searchsorted(time, span, "left")
    begin, end = max(int(first) - 1, 0), min(int(last) + 1, len(time))  # a line to either edge
    if end - begin <= points:
        return time[begin:end], values[begin:end]

    edges = np.linspace(*span, points // 2 + 1)
    places = np.searchsorted(time, edges, "left").astype(np.intp)
    low, high, rising = _extremes(values, places)
    middles = np.stack((edges[:-1], 0.5 * (edges[:-1] + edges[1:])), axis=1)
    pairs = np.stack((np.where(rising, low, high), np.where(rising, high, low)), axis=1)

    return middles.ravel(), pairs.reshape(-1, values.shape[1])


def _extremes(values: Array, places: NDArray[np.intp]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Least and greatest (b, m) of the rows from each place to the next, places (b + 1,), and
    whether a column ends above where it begins.
    """
    filled = np.diff(places) > 0
    starts, ends = places[:-1][filled], places[1:][filled]
    low = np.full((len(filled), values.shape[1]), np.nan)
    high, rising = low.copy(), np.ones(low.shape, bool)

    if len(starts):
        kept = values[starts[0] : ends[-1]]
        low[filled] = np.fmin.reduceat(kept, starts - starts[0])
        high[filled] = np.fmax.reduceat(kept, starts - starts[0])
        rising[filled] = values[ends - 1] >= values[starts]
    return low, high, rising
