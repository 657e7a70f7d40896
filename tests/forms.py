"""Learnt discrepancies of form, drawn by chance, and one as YAML."""

from __future__ import annotations

import numpy as np

from gritd.estimator.model.discrepancy import CONDITIONS
from gritd.estimator.model.learnt import ChannelForm, Domain, LearntForm, LearntSoil

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


def form(seed=0, points=6, directions=3, soil=None, pull=True, size=0.05, torque=True):
    """A δ whose sizes are that share of usual torque, pull and sinkage at 60 N."""
    rng = np.random.default_rng(seed)
    where = np.zeros((points, len(CONDITIONS)))
    where[:, 0] = np.linspace(0.3, 2.4, points)  # slip 0.075 to 0.6
    where[:, 1] = rng.permutation(np.linspace(-1.2, 1.0, points))  # 33 to 99 N
    where[:, 3] = 1.43  # forward
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
