"""What several runs on one bed know together: the posterior handed from run to run.

The bed has a soil s. Every run drives on it after a preparation, on s + d, where d is zero mean
with the stated repeatability Q. A run begins with what is known of s, widened by Q; what it leaves
is told of s by the regression of s on the run's soil and the calibration's errors ν, which are the
same in all runs and correlated with both. With Q = 0 the run's posterior is the bed's.
Source: Kalman filter with the preparation as process noise, smoothed back to the common mean
(Rauch, Tung, Striebel 1965, AIAA J. 3, 1445-1450), ν considered (Schmidt 1966).
"""

from __future__ import annotations

import hashlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.settings import Repeatability, Settings
from gritd.estimator.filter.estimate import KPA, STATES, Estimate, Vector
from gritd.estimator.filter.segments import Memory
from gritd.estimator.filter.track import TrackState

Array = NDArray[np.float64]
LEAST = 1e-9  # of the largest narrowing: a direction that was narrowed by less was not measured


class Known(NamedTuple):
    """What is known of a bed."""

    estimate: Estimate  # of the soil that all preparations have in common
    runs: int  # that it rests on


def variances_of(repeatability: Repeatability) -> Vector:
    """Of one preparation about the bed's soil (3,), in the units of the filter's state."""
    return (
        (repeatability.cohesion / KPA) ** 2,
        repeatability.tan_phi**2,
        repeatability.shear_modulus**2,
    )


def before_run(known: Known, repeatability: Repeatability) -> Estimate:
    """What is known of the soil of the next run."""
    if known.runs == 0:  # the prior is of the soil under the wheel
        return known.estimate
    x, P, cross = known.estimate
    widened = np.array(P) + np.diag(variances_of(repeatability))
    return Estimate(x, _rows(widened), cross)


def after_run(
    known: Known, after: Estimate, repeatability: Repeatability, nuisances: Vector
) -> Known:
    """What is known of the bed after a run that began with `before_run` and left `after`.

    nuisances: variances of the calibration's errors (q,).
    """
    if known.runs == 0:
        return Known(_of_bed(after, repeatability), 1)

    x, P, X = (np.array(part) for part in known.estimate)
    before = before_run(known, repeatability)
    V = np.diag(nuisances)
    joint = np.block([[np.array(before.P), X], [X.T, V]])  # of the run's soil and ν
    gain = np.hstack([P, X]) @ np.linalg.pinv(joint)

    moved = np.array(after.x) - np.array(before.x)
    learnt = np.block([[np.array(after.P), np.array(after.cross)], [np.array(after.cross).T, V]])
    rest = P - gain @ joint @ gain.T  # what the run and ν leave open of the bed

    together = gain @ learnt
    return Known(
        Estimate(
            tuple((x + gain[:, :STATES] @ moved).tolist()),
            _rows(_symmetric(together @ gain.T + rest)),
            _rows(together[:, STATES:]),
        ),
        known.runs + 1,
    )


def _of_bed(after: Estimate, repeatability: Repeatability) -> Estimate:
    """What the first run tells of the bed: its own soil, known as well as it is, and the
    preparation.
    """
    return Estimate(
        after.x, _rows(np.array(after.P) + np.diag(variances_of(repeatability))), after.cross
    )


def begun(fresh: TrackState, estimate: Estimate) -> TrackState:
    """The state that a tracker starts with, with an estimate in the place of the prior."""
    return fresh._replace(estimate=estimate, memory=Memory(estimate))


def surprise(before: Estimate, after: Estimate) -> float:
    """How far a run moved the estimate: squared, over the variance by which it was narrowed.

    Chi-square with as many degrees of freedom as states where the run's soil is the one expected.
    """
    moved = np.array(after.x) - np.array(before.x)
    narrowed = np.array(before.P) - np.array(after.P)
    values, vectors = np.linalg.eigh(_symmetric(narrowed))
    known = values > LEAST * max(float(values[-1]), 0.0)
    return float(np.sum((vectors.T @ moved)[known] ** 2 / values[known]))


def fingerprint(settings: Settings) -> str:
    """What has to be the same for a posterior to be handed on: prior, wheel, calibration, effects.
    The load of a run and its place on the bed may differ.
    """
    parts = (
        settings.soil,
        settings.wheel,
        settings.pulley_radius,
        settings.drive,
        settings.load.nominal.sigma,
        sorted((name, channel.calibration) for name, channel in settings.channels.items()),
        settings.wrench,
        settings.filter,
        settings.effects,
        *([settings.discrepancy] if settings.discrepancy is not None else []),
    )

    return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]


def _symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)


def _rows(matrix: Array) -> tuple[Vector, ...]:
    return tuple(tuple(row) for row in matrix.tolist())
