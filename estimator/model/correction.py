"""δ, as it was learnt (learnt.py), at given conditions: its mean, its columns, its rest."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from gritd.estimator.model.discrepancy import (
    DIRECTION,
    LOAD,
    SLIP,
    SPEED,
    Usual,
    conditions_of,
    covariance,
    weight_of,
)
from gritd.estimator.model.learnt import SIGNED, ChannelForm, LearntForm
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Array

NUGGET = 1e-6  # of the prior variance: points that nearly coincide, once rounded, still have a root
LEFT_OUT = 0.02  # of the prior variance: so much the points may leave out where δ was learnt
CHUNK = 4096  # samples evaluated together: their kernels stay small
DIRECTIONS = {"forward": (1.0, 1.0), "backward": (-1.0, -1.0), "both": (-1.0, 1.0)}


class At(NamedTuple):
    """δ of torque [N·m], drawbar pull [N] and sinkage [m] at n conditions."""

    mean: Array  # (n, 3)
    columns: Array  # (n, 3, r) what one σ of each direction changes
    rest: Array  # (n, 3) standard deviation of what no direction holds


class Correction:
    """A learnt δ, ready to be evaluated."""

    def __init__(self, form: LearntForm) -> None:
        """Raises LinAlgError where two points are the same."""
        self.usual = Usual(form.load, form.speed)
        self.directions = form.directions
        self._points = np.array(form.points)
        self._root = root_of(self._points)

        parts = [_columns(channel, form) for channel in form.channels]
        # (m, 3 (1 + r)) means and directions in units of the kernel
        self._weights = np.linalg.solve(self._root.T, np.hstack(parts))

        given = [channel or ChannelForm(0.0, (), ()) for channel in form.channels]
        self._size = np.array([channel.size for channel in given])
        self._kept = np.array([1.0 - channel.rest**2 for channel in given])
        self._low, self._high = _domain(form, self.usual)

    def features(self, conditions: Array) -> Array:
        """φ (n, m) at conditions (n, d)."""
        between = covariance(conditions, self._points)
        return np.asarray(np.linalg.solve(self._root, between.T).T)

    def inside(self, conditions: Array) -> Array:
        """ρ (n,) at conditions (n, d): 1 inside the domain, 0 far outside."""
        known = conditions[:, : len(self._low)]
        beyond = np.maximum(self._low - known, 0.0) + np.maximum(known - self._high, 0.0)
        return np.asarray(np.exp(-0.5 * np.sum(beyond**2, axis=1)))

    def learnt(self, inside: Array, squares: Array) -> Array:
        """Share (n,) of the prior variance that was learnt of, from ρ (n,) and |φ|² (n,)."""
        return np.asarray(inside**2 * np.minimum(squares + LEFT_OUT, 1.0))

    def at(self, conditions: Array, weight: Array) -> At:
        """δ at conditions (n, d) and weights (n, 3): see discrepancy.weight_of."""
        between = covariance(conditions, self._points)
        inside = self.inside(conditions)
        half = np.linalg.solve(self._root, between.T)
        learnt = self.learnt(inside, np.sum(half**2, axis=0))

        scale = weight * self._size
        values = (between @ self._weights).reshape(len(inside), 3, 1 + self.directions)
        values = values * (scale * inside[:, None])[:, :, None]
        rest = np.abs(scale) * np.sqrt(1.0 - learnt[:, None] * self._kept)
        return At(values[:, :, 0], values[:, :, 1:], rest)

    def of(self, situation: Situation) -> Array:
        """The mean (n, 3) in every situation (n,) of one run, or of several one after another."""
        load = np.atleast_1d(np.asarray(situation.load, float))
        speed = np.abs(situation.radius * np.asarray(situation.wheel_speed, float))
        shape = np.broadcast_shapes(load.shape, np.shape(speed), np.shape(situation.slip))
        full = [
            np.broadcast_to(np.asarray(value, float), shape)
            for value in (situation.slip, load, speed, situation.direction, situation.wheel_angle)
        ]

        parts = []
        for run in _runs(situation, shape[0]):
            slip, weights, rim, direction, angle = (value[run] for value in full)
            travel = situation.radius * np.cumsum(np.abs(np.diff(angle, prepend=angle[:1])))
            conditions = conditions_of(slip, weights, rim, direction, travel, self.usual)
            weight = weights_of(weights, rim, direction, self.usual)
            for start in range(0, len(conditions), CHUNK):
                part = slice(start, start + CHUNK)
                parts.append(self.at(conditions[part], weight[part]).mean)

        return np.concatenate(parts)


def root_of(points: Array) -> Array:
    """Cholesky root (m, m) of the covariance of points (m, d)."""
    return np.asarray(np.linalg.cholesky(covariance(points, points) + NUGGET * np.eye(len(points))))


def weights_of(load: Array, speed: Array, direction: Array, usual: Usual) -> Array:
    """Weights (n, 3) of all channels."""
    parts = [weight_of(load, speed, direction, usual, signed) for signed in SIGNED]
    return np.column_stack(parts)


def _columns(channel: ChannelForm | None, form: LearntForm) -> Array:
    """Mean and directions (m, 1 + r)."""
    if channel is None:
        return np.zeros((len(form.points), 1 + form.directions))
    return np.column_stack((channel.mean, *channel.spread))


def _domain(form: LearntForm, usual: Usual) -> tuple[Array, Array]:
    """Ends (4,) of slip, load, speed and direction, in units of their lengths."""
    of = form.domain
    ends = (
        np.array(of.slip) / SLIP,
        np.log(np.array(of.load) / usual.load) / LOAD,
        np.log(np.array(of.speed) / usual.rim_speed) / SPEED,
        np.array(DIRECTIONS[of.travel]) / DIRECTION,
    )
    low, high = np.array(ends).T
    return low, high


def _runs(situation: Situation, count: int) -> list[slice]:
    """Where each run lies among samples (n,)."""
    number = np.broadcast_to(np.asarray(situation.run, float), (count,))
    edges = [0, *(np.flatnonzero(np.diff(number)) + 1).tolist(), count]
    return [slice(a, b) for a, b in itertools.pairwise(edges)]
