"""Whether an estimate that is read back is one: not by its shape alone."""

from __future__ import annotations

import numpy as np

from gritd.estimator.filter.estimate import STATES, Estimate, covariance

ROUNDING = 1e-6  # of a correlation: below zero by no more


def unsound(estimate: Estimate) -> str:
    """Why it is no estimate; '' where it is one. A parameter that is exact has a variance of 0."""
    size = len(estimate.x)
    if size < STATES or len(estimate.packed) != 8 * size * size:
        return "not a mean and its covariance"

    P = covariance(estimate)
    if not (np.all(np.isfinite(estimate.x)) and np.all(np.isfinite(P))):
        return "not finite"

    scale = np.sqrt(np.maximum(np.diag(P), 0.0))
    unit = P / np.outer(scale + (scale == 0.0), scale + (scale == 0.0))
    negative = np.any(np.diag(P) < 0.0) or float(np.linalg.eigvalsh(unit)[0]) < -ROUNDING
    return "not a covariance" if negative or not np.array_equal(P, P.T) else ""
