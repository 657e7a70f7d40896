"""The filter's algebra in numpy, every sum in a stated order: the default engine where nothing was
compiled, equal to filterpy's to rounding.

With M = P Hᵀ, S = H M + R = L Lᵀ and U = M L⁻ᵀ the update reads

    x + U L⁻¹ y        and        P − U Uᵀ,

which keeps P symmetric to the bit.
"""

from __future__ import annotations

from math import log, sqrt

import numpy as np

from gritd.estimator.compiled import arithmetic
from gritd.estimator.filter.estimate import (
    Estimate,
    Update,
    Vector,
    covariance,
    made,
    plain_dot,
    times,
)
from gritd.estimator.terramechanics.soil import Array


class PlainEngine:
    """See engine.Engine."""

    def update(self, estimate: Estimate, update: Update) -> Estimate:
        P = covariance(estimate)
        whitened: list[tuple[Array, float]] = []
        shares: list[tuple[Vector, float]] = []
        logs = squares = 0.0

        # component by component, each less what it shares with the one before
        for at, (y, h, r) in enumerate(zip(*update, strict=True)):
            m = times(P, h)
            slopes = [(plain_dot(h, moved) + r[n]) / s for n, (moved, s) in enumerate(shares)]
            rest = plain_dot(h, m) + r[at]
            u, left = np.array(m), y
            for slope, (other, score) in zip(slopes, whitened, strict=True):
                rest, left = rest - slope * slope, left - slope * score
                u = u - slope * other
            s = _root(rest)
            shares.append((m, s))
            whitened.append((u / s, left / s))
            logs, squares = logs + log(s), squares + (left / s) * (left / s)

        x = np.array(estimate.x)
        for u, score in whitened:
            x = x + u * score
            P = P - u[:, None] * u
        evidence = estimate.log_evidence + (-0.5 * squares - logs)
        return made(tuple(x.tolist()), P, evidence)


class CompiledEngine:
    """The same, compiled (compiled/algebra.c), to the same bits."""

    def update(self, estimate: Estimate, update: Update) -> Estimate:
        x, packed, evidence = arithmetic.update(estimate.x, estimate.packed, *update)
        return Estimate(x, packed, estimate.log_evidence + evidence)


def _root(variance: float) -> float:
    """Raises ZeroDivisionError where the covariance of the innovations is singular."""
    if not variance > 0.0:
        raise ZeroDivisionError("the covariance of the innovations is singular")
    return sqrt(variance)
