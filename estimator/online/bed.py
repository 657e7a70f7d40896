"""What several runs on one bed know together: the posterior handed from run to run.

The bed has a soil s. Every run drives on it after a preparation, on s + d, where d is zero mean
with the stated repeatability Q. A run begins with what is known of s, widened by Q; what it leaves
is known of s by the regression of s on the run's soil and on the errors ν, which are the same in
all runs and correlated with both. With Q = 0 the run's posterior is the bed's.
Source: Kalman filter with the preparation as process noise, smoothed back to the common mean
(Rauch, Tung, Striebel 1965, AIAA J. 3, 1445-1450).
"""

from __future__ import annotations

import hashlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.settings import Repeatability, Settings
from gritd.estimator.filter.bank import Bank, reported
from gritd.estimator.filter.estimate import (
    KPA,
    STATES,
    Estimate,
    Vector,
    covariance,
    made,
    predict,
)
from gritd.estimator.filter.segments import Memory
from gritd.estimator.filter.track import TrackState

Array = NDArray[np.float64]
LEAST = 1e-9  # of the largest narrowing: a direction that was narrowed by less was not measured


class Known(NamedTuple):
    """What is known of a bed."""

    bank: Bank  # of the soil that all preparations have in common, and the shared errors
    runs: int  # that it rests on
    # the record of the runs, where they are of one soil: it can be linearised once more
    memory: Memory | None = None

    @property
    def estimate(self) -> Estimate:
        """What the members of the bank say together."""
        return reported(self.bank)


class RunStart(NamedTuple):
    """What a run begins with in the place of the prior."""

    bank: Bank
    memory: Memory | None = None


def variances_of(repeatability: Repeatability) -> Vector:
    """Of one preparation about the bed's soil (3,), in the units of the filter's state."""
    return (
        (repeatability.cohesion / KPA) ** 2,
        repeatability.tan_phi**2,
        repeatability.shear_modulus**2,
    )


def before_run(known: Known, repeatability: Repeatability) -> RunStart:
    """What the next run begins with."""
    if known.runs == 0:  # the prior is of the soil under the wheel
        return RunStart(known.bank)
    return RunStart(_widened(known.bank, repeatability), known.memory)


def after_run(
    known: Known, after: Bank, repeatability: Repeatability, memory: Memory | None = None
) -> Known:
    """What is known of the bed after a run that began with `before_run` and left `after`; memory:
    its record, where that may go on in the next run.
    """
    runs = known.runs + 1
    if repeatability == Repeatability():  # the same soil
        return Known(after, runs, memory)
    if known.runs == 0:
        return Known(_widened(after, repeatability), runs)

    members = zip(known.bank, _widened(known.bank, repeatability), after, strict=True)
    return Known(tuple([_of_bed(*each) for each in members]), runs)


def _widened(bank: Bank, repeatability: Repeatability) -> Bank:
    """By one preparation."""
    return tuple([predict(member, variances_of(repeatability)) for member in bank])


def _of_bed(bed: Estimate, before: Estimate, after: Estimate) -> Estimate:
    """The bed's soil and the shared errors ν, from those of the run: [s, ν] regressed on
    [s + d, ν].
    """
    P, joint = covariance(bed), covariance(before)
    gain = P @ np.linalg.pinv(joint, hermitian=True)
    moved = np.array(after.x) - np.array(before.x)
    left = P - gain @ joint @ gain.T  # what the run leaves open of the bed

    x = np.array(bed.x) + gain @ moved
    together = gain @ covariance(after) @ gain.T + left
    return made(tuple(x.tolist()), _symmetric(together), after.log_evidence)


def begun(fresh: TrackState, start: RunStart) -> TrackState:
    """The state that a tracker starts with, with what is known in the place of the prior."""
    bank, memory = start
    memory = Memory(bank) if memory is None else memory.ended()
    return fresh._replace(estimate=reported(bank), base=bank, bank=bank, memory=memory)


def surprise(before: Estimate, after: Estimate) -> float:
    """How far a run moved the estimate: squared, over the variance by which it was narrowed.

    Chi-square with as many degrees of freedom as states where the run's soil is the one expected.
    """
    moved = np.array(after.x[:STATES]) - np.array(before.x[:STATES])
    narrowed = np.array(before.soil_P) - np.array(after.soil_P)
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
        settings.peak,
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
