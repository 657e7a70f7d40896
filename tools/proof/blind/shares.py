"""Counts with their intervals, and quantiles, as JSON types."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.stats import beta


@dataclass(frozen=True)
class Share:
    """k of n, with the 95 % interval of Clopper and Pearson (1934)."""

    k: int
    n: int
    low: float
    high: float

    @property
    def value(self) -> float:
        return self.k / self.n if self.n else math.nan


def share(outcomes: Iterable[bool]) -> Share:
    """How many of the outcomes are so."""
    given = list(outcomes)
    k, n = sum(given), len(given)
    low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
    high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
    return Share(k, n, low, high)


def counted(outcomes: Iterable[bool]) -> dict[str, Any]:
    """`share` as JSON types."""
    return asdict(share(outcomes))


def quantiles(values: Sequence[float]) -> dict[str, Any]:
    """Of the finite ones."""
    finite = [value for value in values if math.isfinite(value)]
    if not finite:
        return {"n": 0, "quarter": None, "median": None, "three quarters": None}
    quarter, median, most = np.quantile(finite, (0.25, 0.5, 0.75)).tolist()
    return {"n": len(finite), "quarter": quarter, "median": median, "three quarters": most}
