"""What follows late, over a time or over a way: a lag, and a mean over the latest stretch."""

from __future__ import annotations

import numpy as np

from gritd.tools.proof.blind.plant.quadrature import Array


def lagged(values: Array, passed: Array, length: float) -> Array:
    """Values (n,) that follow over a length of what has passed between the samples (n,): dy/ds =
    (x − y)/λ, exact where x is a straight line from sample to sample.
    """
    behind, gaps = 0.0, []
    keep = np.exp(-passed / max(length, 1e-12))
    slope = np.diff(values, prepend=values[0]) / np.maximum(passed, 1e-12)
    for kept, steady in zip(keep.tolist(), (length * slope).tolist(), strict=True):
        behind = steady + kept * (behind - steady)
        gaps.append(behind)
    return np.asarray(values - np.array(gaps))


def mean_before(values: Array, path: Array, length: float) -> Array:
    """Mean (n,) over the last `length` of a rising path (n,), of straight lines between the values;
    before the path began, the first value.
    """
    if length < 1e-6:
        return values

    area = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(path))))
    start = np.maximum(path - length, path[0])
    place = np.clip(np.searchsorted(path, start, "right") - 1, 0, path.size - 1)
    begun = area[place] + 0.5 * (values[place] + np.interp(start, path, values)) * (
        start - path[place]
    )

    lacking = np.maximum(path[0] - (path - length), 0.0) * values[0]
    return np.asarray((area - begun + lacking) / length)
