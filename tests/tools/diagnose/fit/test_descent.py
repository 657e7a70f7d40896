"""A descent that says it has converged stands at the optimum within the bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.descent import Bounds, descend

UNKNOWNS = 12
FAR = 8.0  # bounds


@dataclass(frozen=True)
class _Place:
    centre: Array
    nats: float
    gradient: Array
    curvature: Array


class _Bowl:
    """½ |A x − b|² in nats, with unknowns that can hardly be told apart."""

    def __init__(self, rng: np.random.Generator) -> None:
        directions = np.linalg.qr(rng.standard_normal((UNKNOWNS, UNKNOWNS)))[0]
        self.a = directions * np.geomspace(1.0, 300.0, UNKNOWNS) @ directions.T
        self.b = self.a @ (2.0 * FAR * rng.standard_normal(UNKNOWNS))
        self.bounds = Bounds(np.full(UNKNOWNS, -FAR), np.full(UNKNOWNS, FAR))

    def tried(self, centre: Array) -> tuple[Array, float]:
        return centre, 0.5 * float(np.sum((self.a @ centre - self.b) ** 2))

    def linearised(self, tried: Array) -> _Place:
        gradient = self.a.T @ (self.a @ tried - self.b)
        return _Place(tried, self.tried(tried)[1], gradient, self.a.T @ self.a)

    def moved(self, here: _Place, tried: Array) -> _Place:
        return self.linearised(tried)

    def least(self) -> float:
        return float(lsq_linear(self.a, self.b, (-FAR, FAR), tol=1e-12).cost)


@pytest.mark.parametrize("seed", range(20))
def test_a_converged_descent_ends_at_the_optimum_within_the_bounds(seed: int) -> None:
    """Most unknowns end at a bound: steps are cut, and may be cut into ones that lose."""
    bowl = _Bowl(np.random.default_rng(seed))
    start = bowl.linearised(np.zeros(UNKNOWNS))
    reached, converged = descend(bowl, start, 200)
    assert converged
    assert reached.nats == pytest.approx(bowl.least(), abs=0.5)
