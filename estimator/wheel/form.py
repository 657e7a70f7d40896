"""The learnt discrepancy of form (learnt.py) under one window of the on-line filter, in floats."""

from __future__ import annotations

from math import exp, log, tanh
from typing import NamedTuple

import numpy as np

from gritd.estimator.model.correction import Correction, weights_of
from gritd.estimator.model.discrepancy import (
    DIRECTION,
    LAG,
    LOAD,
    LOAD_LAG,
    LOAD_TRAVEL,
    SLIP,
    SPEED,
    START,
    START_TRAVEL,
    TRAVELS,
)
from gritd.estimator.model.learnt import LearntForm, Vector
from gritd.estimator.stages.situation import CREEP, Recall

NAME = "discrepancy"  # of what is remembered, in addition to what effects remember by their names
Three = tuple[float, float, float]  # of torque [N·m], drawbar pull [N], sinkage [m]


class FormHere(NamedTuple):
    """δ under a window: its mean, what one σ of each direction changes, σ of the rest."""

    mean: Three
    columns: tuple[Three, ...]  # (r,)
    rest: Three
    conditions: Vector  # (d,)
    weight: Three

    def mixed(self, other: FormHere, weight: float) -> FormHere:
        """The mean of two, `weight` on the other."""

        def blend(one: Vector, two: Vector) -> Vector:
            return tuple([a + (b - a) * weight for a, b in zip(one, two, strict=True)])

        pairs = zip(self.columns, other.columns, strict=True)
        return FormHere(
            _three(blend(self.mean, other.mean)),
            tuple([_three(blend(a, b)) for a, b in pairs]),
            _three(blend(self.rest, other.rest)),
            blend(self.conditions, other.conditions),
            _three(blend(self.weight, other.weight)),
        )


class Wheeling(NamedTuple):
    """What the conditions of a window are made of, SI."""

    slip: float
    load: float
    rim_speed: float
    travel_speed: float
    wheel_angle: float


class FormOnLine:
    """A learnt δ, one window after another."""

    def __init__(self, form: LearntForm, radius: float) -> None:
        self._correction, self._radius = Correction(form), radius
        self._load, self._speed = form.load, form.speed

    def at(self, now: Wheeling, memory: Recall) -> FormHere:
        """δ under a window. memory: what `remember` left after the last one."""
        lags = self._lagging(now, memory)
        slip, load = _short(now.slip), self._log_load(now)
        speed = log(max(abs(now.rim_speed), 1e-6) / self._speed)
        direction = tanh((now.rim_speed + now.travel_speed) / (2.0 * CREEP))

        conditions = (
            slip / SLIP,
            load / LOAD,
            speed / SPEED,
            direction / DIRECTION,
            *[(lag - slip) / LAG for lag in lags[:-2]],
            (lags[-2] - load) / LOAD_LAG,
            lags[-1] / START,
        )

        touched = weights_of(
            np.array([now.load]),
            np.array([abs(now.rim_speed)]),
            np.array([direction]),
            self._correction.usual,
        )

        return self._evaluated(conditions, _three(touched[0].tolist()))

    def at_slip(self, here: FormHere, slip: float) -> FormHere:
        """δ at another slip that is held, all else as under a window."""
        steady = (_short(slip) / SLIP, *here.conditions[1:4], *(0.0,) * len(here.conditions[4:]))
        return self._evaluated(steady, here.weight)

    def remember(self, now: Wheeling, memory: Recall) -> Recall:
        """Slips and ln load a while ago and what is left of the start, after a window, and the
        wheel angle there.
        """
        return (*self._lagging(now, memory), now.wheel_angle)

    def _lagging(self, now: Wheeling, memory: Recall) -> Vector:
        """Low-passes along the travel of the rim: of the slip over TRAVELS, of ln load over
        LOAD_TRAVEL, and of a start over START_TRAVEL.
        """
        present = (*(_short(now.slip),) * len(TRAVELS), self._log_load(now))
        if not memory:
            return (*present, 1.0)

        *before, angle = memory
        travel = self._radius * abs(now.wheel_angle - angle)
        kept = [exp(-travel / length) for length in (*TRAVELS, LOAD_TRAVEL, START_TRAVEL)]
        every = zip(kept, before, (*present, 0.0), strict=True)
        return tuple([k * b + (1.0 - k) * p for k, b, p in every])

    def _log_load(self, now: Wheeling) -> float:
        return log(max(now.load, 1e-3) / self._load)

    def _evaluated(self, conditions: Vector, weight: Three) -> FormHere:
        correction = self._correction.at(np.array([conditions]), np.array([weight]))
        columns = tuple([_three(column) for column in correction.columns[0].T.tolist()])
        mean, rest = correction.mean[0].tolist(), correction.rest[0].tolist()
        return FormHere(_three(mean), columns, _three(rest), conditions, weight)


def _short(slip: float) -> float:
    return min(max(slip, -1.0), 1.0)


def _three(values: list[float] | Vector) -> Three:
    torque, pull, sinkage = values
    return torque, pull, sinkage
