"""Damped descent to an optimum within bounds.

Levenberg (1944) and Marquardt (1963) with the curvature of least squares; a coordinate whose
gradient points out of its bounds is held there (active set, Bertsekas 1982, SIAM J. Control
Optim. 20, 221-246). The descent ends where the undamped step would gain next to nothing, by the
slopes of the very place, so a fit that says `converged` stands at an optimum and not where the
rounds ran out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Bools
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import DAMPING_LEAST, ROUNDING


@dataclass(frozen=True, eq=False)
class CoordinateBounds:
    """Of every coordinate: low and high (n,)."""

    low: Array
    high: Array

    def clipped(self, centre: Array) -> Array:
        """Coordinates (n,) within the bounds."""
        return np.asarray(np.clip(centre, self.low, self.high))

    def reached(self, centre: Array) -> Bools:
        """Coordinates (n,) that stand at a bound."""
        at: Bools = (centre <= self.low + ROUNDING) | (centre >= self.high - ROUNDING)
        return at

    def held(self, centre: Array, gradient: Array) -> Bools:
        """Coordinates (n,) that stand at a bound and want out."""
        held: Bools = ((centre <= self.low + ROUNDING) & (gradient > 0.0)) | (
            (centre >= self.high - ROUNDING) & (gradient < 0.0)
        )
        return held


class DescentPoint(Protocol):
    """Where a descent stands: an objective in nats, its gradient (n,), its curvature (n, n)."""

    @property
    def centre(self) -> Array:
        """Coordinates (n,)."""

    @property
    def nats(self) -> float:
        """Objective."""

    @property
    def gradient(self) -> Array:
        """(n,) in nats a unit of each coordinate."""

    @property
    def curvature(self) -> Array:
        """(n, n)."""


Here = TypeVar("Here", bound=DescentPoint)
Linearised = TypeVar("Linearised", bound=DescentPoint, covariant=True)
Tried = TypeVar("Tried")


class Objective(Protocol[Linearised, Tried]):
    """What is descended."""

    @property
    def bounds(self) -> CoordinateBounds: ...

    @property
    def curved(self) -> Bools:
        """Coordinates (n,) along which the function bends: valleys are curved there, and the other
        coordinates have to follow.
        """

    def tried(self, centre: Array) -> tuple[Tried, float]:
        """The function at coordinates (n,), not linearised, and its objective [nats]."""

    def linearised(self, tried: Tried) -> Linearised: ...

    def moved(self, here: Any, tried: Tried) -> Linearised:
        """There, with the slopes of a place near by, corrected by what the way there showed of them
        (Broyden 1965, Mathematics of Computation 19, 577-593).
        """

    def followed(self, here: Any, tried: Tried) -> Linearised:
        """There, with new slopes of few coordinates: the others hardly change."""


def descend(
    ground: Objective[Here, Tried], start: Here, rounds: int, unsure: Tried | None = None
) -> tuple[Here, bool]:
    """The optimum that is reached from a start in so many linearisations; whether it is one.

    unsure: where it stands, if its slopes are those of another place.
    """
    here, damping, failed = start, TUNING.numerics.damping_start, False

    for _ in range(rounds):
        better = None
        while better is None and damping < 1.0 / DAMPING_LEAST:
            done = abs(_undamped_gain(here, ground.bounds)) < TUNING.numerics.gain
            if done and unsure is None:
                return here, True
            if unsure is not None and (done or failed):  # by these slopes
                here, unsure, failed = ground.linearised(unsure), None, False
                continue

            step = bounded_step(here, ground.bounds, _held(here, ground.bounds), damping)
            tried, share, bent = None, 0.0, False
            if (expected := _gain(here, step)) > 0.0:  # bounds may cut a step into one that loses
                tried, share, bent = _attempt(ground, here, step, expected, damping)
            if share > TUNING.numerics.fulfilled:
                better, failed = tried, False
                softer = 1.0 / TUNING.numerics.damping if share > TUNING.numerics.good else 1.0
                damping = max(damping * softer, DAMPING_LEAST)
            else:
                damping, failed = damping * TUNING.numerics.damping, True

        if better is None:
            return here, False
        here, unsure = ground.moved(here, better), better
        if bent or share <= TUNING.numerics.good:
            here = ground.followed(here, better)
    if unsure is not None:
        here = ground.linearised(unsure)
    return here, abs(_undamped_gain(here, ground.bounds)) < TUNING.numerics.gain


def _held(here: DescentPoint, bounds: CoordinateBounds) -> Bools:
    return bounds.held(here.centre, here.gradient)


def _attempt(
    ground: Objective[Here, Tried], here: Here, step: Array, expected: float, damping: float
) -> tuple[Tried, float, bool]:
    """Where a step (n,) leads, its share of the expected gain [nats], and whether the step alone
    misses it because the valley is curved: then all that is not curved follows what is.
    """
    tried, nats = ground.tried(ground.bounds.clipped(here.centre + step))
    share = (here.nats - nats) / expected
    if share > TUNING.numerics.good or not np.isfinite(nats) or not ground.curved.any():
        return tried, share, share <= TUNING.numerics.good

    there = ground.moved(here, tried)
    follow = bounded_step(
        there, ground.bounds, ground.curved | _held(there, ground.bounds), damping
    )
    beside, lower = ground.tried(ground.bounds.clipped(there.centre + follow))
    return (beside, (here.nats - lower) / expected, True) if lower < nats else (tried, share, True)


def _undamped_gain(here: DescentPoint, bounds: CoordinateBounds) -> float:
    """What the step without damping would gain by the linearised function [nats]."""
    return _gain(here, bounded_step(here, bounds, _held(here, bounds), DAMPING_LEAST))


def _gain(here: DescentPoint, step: Array) -> float:
    """What a step would gain by the linearised function [nats]."""
    return float(-(here.gradient @ step + 0.5 * step @ here.curvature @ step))


def bounded_step(
    here: DescentPoint, bounds: CoordinateBounds, held: Bools, damping: float
) -> Array:
    """The damped step (n,) that leaves no bound: coordinates that would are put on theirs."""
    held, step = held.copy(), np.zeros(here.centre.size)
    low, high = bounds.low - here.centre, bounds.high - here.centre
    for _ in range(here.centre.size):
        free = np.flatnonzero(~held)
        if not free.size:
            break

        curvature = here.curvature[np.ix_(free, free)]
        pull = here.gradient[free] + here.curvature[np.ix_(free, held)] @ step[held]
        damped = curvature + damping * np.diag(np.diag(curvature))
        step[free] = -np.linalg.solve(damped, pull)

        beyond = ~held & ((step < low - ROUNDING) | (step > high + ROUNDING))
        if not beyond.any():
            break
        step = np.asarray(np.clip(step, low, high))
        held |= beyond
    return np.asarray(np.clip(step, low, high))
