"""How much the readings of a column scatter, from the column itself."""

from __future__ import annotations

import math

import numpy as np

from gritd.tools.importers.files import Array

KEPT = 0.98  # share of the smallest: what a step or a spike leaves out of line is no noise
NORMAL = 0.9346  # root mean square of these, of normal scatter, over its standard deviation
ROUNDING = 1.0 / math.sqrt(12.0)  # standard deviation of a rounding error, in the last digit

MOST = 1_000_000  # rows that are looked at: bounds memory and time …
SIDE_BY_SIDE = 1000  # … in pieces of so many


def scatter(seconds: Array, values: Array, resolution: float) -> float:
    """Standard deviation of one reading about the line through its neighbours, and of the rounding
    to the last digit at least; arrays (n,), NaN in a gap. 0 where neither can be determined.

    Noise that has been filtered before the file was written looks smaller than it is.
    """
    if values.size > MOST:
        some = np.arange(values.size) // SIDE_BY_SIDE % (values.size // MOST + 1) == 0
        seconds, values = seconds[some], values[some]
    known = np.isfinite(values)
    t, v = seconds[known], values[known]
    rounding = ROUNDING * (resolution or spacing(v))
    if t.size < 5:
        return rounding

    weight = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
    between = v[:-2] + weight * (v[2:] - v[:-2])
    off = (v[1:-1] - between) / np.sqrt(1.0 + weight**2 + (1.0 - weight) ** 2)
    least = np.sort(off**2)[: max(int(KEPT * off.size), 1)]
    return max(float(np.sqrt(np.mean(least))) / NORMAL, rounding)


def spacing(values: Array) -> float:
    """What values (n,) are rounded to: 1 where all are whole numbers, else the least step between
    values that repeat; 0 where none do.
    """
    distinct = np.unique(values[np.isfinite(values)])
    if distinct.size > 1 and bool(np.all(distinct == np.round(distinct))):
        return 1.0
    if distinct.size < 2 or distinct.size > 0.5 * values.size:
        return 0.0
    return float(np.min(np.diff(distinct)))
