"""Learnt discrepancies of form, drawn by chance, and one as YAML."""

from __future__ import annotations

import numpy as np

from gritd.estimator.model.discrepancy import CONDITIONS, Usual, conditions_of, features_of
from gritd.estimator.model.learnt import ChannelForm, Domain, LearntForm, LearntSoil
from gritd.estimator.stages.situation import signed_slip

DOMAIN = Domain((0.02, 0.65), (28.0, 110.0), (0.015, 0.04))


def channel(rng, size, points, directions, rest=0.02, scale=0.3):
    spread = scale * rng.standard_normal((directions, points))
    mean = rng.standard_normal(points)
    return ChannelForm(
        size,
        tuple(np.round(mean, 4).tolist()),
        tuple(tuple(row) for row in np.round(spread, 3).tolist()),
        rest,
    )


def held(points, rng):
    """Conditions (points, d) that are held."""
    where = np.zeros((points, len(CONDITIONS)))
    where[:, 0] = np.linspace(0.3, 2.4, points)  # slip 0.075 to 0.6
    where[:, 1] = rng.permutation(np.linspace(-1.2, 1.0, points))  # 33 to 99 N
    where[:, 3] = 1.43  # forward
    return where


def driven(motion, radius, points):
    """Conditions (points, d) of a run, spread as those of a learnt δ are."""
    rim = radius * motion.wheel_speed
    slip, direction = signed_slip(rim, motion.carriage_speed)
    travel = radius * np.abs(motion.wheel_angle)
    given = slip, motion.load, np.abs(rim), direction, travel
    conditions = conditions_of(*given, Usual(60.0, 0.025))
    return features_of(conditions[np.abs(rim) > 0.0], points, 1e-3).points


def form(seed=0, points=6, directions=3, soil=None, pull=True, size=0.05, torque=True, where=None):
    """A δ whose sizes are that share of usual torque, pull and sinkage at 60 N; where: conditions
    (points, d), else some that are held.
    """
    rng = np.random.default_rng(seed)
    where = held(points, rng) if where is None else where
    points = len(where)
    return LearntForm(
        60.0,
        0.025,
        DOMAIN,
        tuple(tuple(row) for row in np.round(where, 2).tolist()),
        channel(rng, size * 2.0, points, directions) if torque else None,
        channel(rng, size * 0.01, points, directions),
        channel(rng, size * 15.0, points, directions) if pull else None,
        soil,
    )


def soil(values, directions=3, correlation=-0.4, among=(-0.3, 0.0, 0.0)):
    row = (correlation,) + (0.0,) * (directions - 1)
    none = (0.0,) * directions
    return LearntSoil(*values, row, none, none, among)
