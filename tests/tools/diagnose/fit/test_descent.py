"""A descent that says it has converged stands at the optimum within the bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.descent import CoordinateBounds, descend
from gritd.tools.diagnose.tuning import TUNING

UNKNOWNS = 12
FAR = 8.0  # bounds


@dataclass(frozen=True)
class _Place:
    centre: Array
    nats: float
    gradient: Array
    curvature: Array


class _Bowl:
    """½ |A x − b|² in nats, with unknowns that can hardly be distinguished."""

    curved = np.zeros(UNKNOWNS, bool)

    def __init__(self, rng: np.random.Generator) -> None:
        directions = np.linalg.qr(rng.standard_normal((UNKNOWNS, UNKNOWNS)))[0]
        self.a = directions * np.geomspace(1.0, 300.0, UNKNOWNS) @ directions.T
        self.b = self.a @ (2.0 * FAR * rng.standard_normal(UNKNOWNS))
        self.bounds = CoordinateBounds(np.full(UNKNOWNS, -FAR), np.full(UNKNOWNS, FAR))

    def tried(self, centre: Array) -> tuple[Array, float]:
        return centre, 0.5 * float(np.sum((self.a @ centre - self.b) ** 2))

    def linearised(self, tried: Array) -> _Place:
        gradient = self.a.T @ (self.a @ tried - self.b)
        return _Place(tried, self.tried(tried)[1], gradient, self.a.T @ self.a)

    def moved(self, here: _Place, tried: Array) -> _Place:
        return self.linearised(tried)

    followed = moved

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


class _Bend:
    """½ |r|² of Rosenbrock's valley: a strength that has to follow a curve of a shape.

    steep: of the valley's flanks.
    """

    bounds = CoordinateBounds(np.full(2, -20.0), np.full(2, 20.0))

    def __init__(self, shown: bool, steep: float = 10.0) -> None:
        """shown: whether the descent knows along which unknown the valley is curved."""
        self.curved = np.array([False, shown])
        self.steep = steep
        self.steps = 0

    def _residual(self, centre: Array) -> Array:
        strength, shape = centre
        return np.array([self.steep * (strength - shape**2), 1.0 - shape])

    def tried(self, centre: Array) -> tuple[Array, float]:
        self.steps += 1
        return centre, 0.5 * float(np.sum(self._residual(centre) ** 2))

    def linearised(self, tried: Array) -> _Place:
        return self._place(tried, tried)

    def moved(self, here: _Place, tried: Array) -> _Place:
        return self._place(here.centre, tried)

    def followed(self, here: _Place, tried: Array) -> _Place:
        return self._place(tried, tried)

    def _place(self, slopes_at: Array, centre: Array) -> _Place:
        slopes = np.array([[self.steep, -2.0 * self.steep * slopes_at[1]], [0.0, -1.0]])
        gradient = slopes.T @ self._residual(centre)
        return _Place(centre, self.tried(centre)[1], gradient, slopes.T @ slopes)


def _rounds(shown: bool, start: float) -> int:
    bend = _Bend(shown)
    reached, converged = descend(bend, bend.linearised(np.array([start**2, start])), 300)
    assert converged and reached.nats < TUNING.numerics.gain
    return bend.steps


@pytest.mark.parametrize("start", [-2.0, -1.0, 3.0])
def test_in_a_curved_valley_a_strength_follows_the_shape(start: float) -> None:
    """Where the descent knows what is curved, it needs fewer steps."""
    assert _rounds(True, start) < _rounds(False, start)


@pytest.mark.parametrize("steep", [30.0, 100.0, 300.0, 1000.0])
def test_in_a_narrow_valley_a_converged_descent_is_near_the_optimum(steep: float) -> None:
    """Also one that does not know what is curved: every step along the valley leaves it."""
    bend = _Bend(False, steep)
    reached, converged = descend(bend, bend.linearised(np.array([9.0, 3.0])), 300)
    assert reached.nats < (TUNING.numerics.gain if converged else 0.5)


@pytest.mark.parametrize("shape", [1.5, 1.9, 2.0])
def test_a_gain_that_damping_hides_is_taken(shape: float) -> None:
    """Along the valley a damped step is short: it foretells next to nothing, the undamped more."""
    bend = _Bend(True, steep=100.0)
    start = bend.linearised(np.array([shape**2, shape]))
    assert start.nats > 0.1
    reached, converged = descend(bend, start, 300)
    assert converged
    assert reached.nats < TUNING.numerics.gain


class _Hidden:
    """½ |r|² of r = (x − ½, 1 − x y, y/100): at x = 0 nothing shows that y could gain."""

    curved = np.zeros(2, bool)
    bounds = CoordinateBounds(np.full(2, -20.0), np.full(2, 20.0))

    def tried(self, centre: Array) -> tuple[Array, float]:
        return centre, 0.5 * float(np.sum(self._residual(centre) ** 2))

    def _residual(self, centre: Array) -> Array:
        x, y = centre
        return np.array([x - 0.5, 1.0 - x * y, 0.01 * y])

    def linearised(self, tried: Array) -> _Place:
        return self._place(tried, tried)

    def moved(self, here: _Place, tried: Array) -> _Place:
        return self._place(here.centre, tried)

    followed = moved

    def _place(self, slopes_at: Array, centre: Array) -> _Place:
        x, y = slopes_at
        slopes = np.array([[1.0, 0.0], [-y, -x], [0.0, 0.01]])
        gradient = slopes.T @ self._residual(centre)
        return _Place(centre, self.tried(centre)[1], gradient, slopes.T @ slopes)


def test_a_descent_ends_by_the_slopes_of_the_place_where_it_ends() -> None:
    """A small step keeps the slopes of its start, which say that nothing is left to gain."""
    hidden = _Hidden()
    reached, converged = descend(hidden, hidden.linearised(np.zeros(2)), 30)
    assert converged
    assert reached.nats < 0.01
