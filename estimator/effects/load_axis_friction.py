"""The vertical axis sticks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.history import path_relaxed, smoothed
from gritd.estimator.stages.situation import Recall, Situation
from gritd.estimator.terramechanics.soil import Scalar

PRESLIDING = 1e-4  # [m] travel over which the friction turns round


@dataclass(frozen=True)
class LoadAxisFriction(Effect):
    """The vertical axis sticks: the soil feels less than the weights while the wheel sinks, more
    while it rises.

    W = w − F s,   ds/dz = (sign(dz) − s)/δ along the path of z
    s = 1 at the start: the wheel was lowered on the soil

    The friction keeps its last direction when the axis stops. Source: presliding model of Dahl
    (1968), Aerospace Corp. TOR-0158(3107-18)-1; Armstrong-Hélouvry, Dupont, Canudas de Wit (1994),
    Automatica 30, 1083-1138.
    """

    friction: float = strength("friction of the axis, F", "N", typical=2.0, low=0.0, high=30.0)

    stage = "testbed"
    fingerprint = Fingerprint(
        "load", "sinkage", "measured load below the weights after sinking, above them after rising"
    )
    confusable_with = told_apart(sensor_latency="load_step", frame_compliance="load_step")
    needs_sinkage = True
    by_run = True
    at_start = (1.0,)

    def load(self, load: Scalar, situation: Situation) -> Scalar:
        return load - np.minimum(self.friction, np.maximum(load, 0.0)) * self._direction(situation)

    def remember(self, memory: Recall, step: float, situation: Situation) -> Recall:
        (direction,), moved = memory, situation.sinking * step
        share = -np.expm1(-np.abs(moved) / PRESLIDING)
        return (float(direction + (np.sign(moved) - direction) * share),)

    def _direction(self, situation: Situation) -> Scalar:
        """s, −1 after rising … 1 after sinking."""
        if self.name in situation.memory:
            return situation.memory[self.name][0]
        return path_relaxed(smoothed(situation.time, situation.sinkage), PRESLIDING)
