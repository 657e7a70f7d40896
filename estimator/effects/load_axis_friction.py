"""The vertical axis sticks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.history import presliding, run_by_run, smoothed, turned_round
from gritd.estimator.stages.situation import OnSoil, Recall
from gritd.estimator.terramechanics.soil import Array, Scalar


@dataclass(frozen=True)
class LoadAxisFriction(Effect):
    """The vertical axis sticks: the soil feels less than the weights while the wheel sinks, more
    while it rises.

    W = w − F s,   ds/dz = sign(dz) (1 − s sign(dz))^i/δ along the path of z
    s = 1 at the start: the wheel was lowered on the soil

    The friction keeps its last direction when the axis stops. Stiff guides turn it round within
    0.02 mm, plain bushes on soft brackets within a millimetre. With i = 0 it is a spring that
    slips, with i = 1 it nears ±1 more and more slowly. Source: presliding model of Dahl (1968),
    Aerospace Corp. TOR-0158(3107-18)-1; Armstrong-Hélouvry, Dupont, Canudas de Wit (1994),
    Automatica 30, 1083-1138.
    """

    friction: float = strength("friction of the axis, F", "N", typical=2.0, low=0.0, high=30.0)
    travel: float = shape(
        "travel over which the friction turns round, δ",
        "m",
        mean=2e-4,
        sigma=4e-4,
        low=2e-5,
        high=3e-3,
    )
    exponent: float = shape(
        "how slowly it turns round at last, i", "", mean=1.0, sigma=0.5, low=0.0, high=3.0
    )

    stage = "testbed"
    fingerprint = Fingerprint(
        "load", "sinkage", "measured load below the weights after sinking, above them after rising"
    )
    confusable_with = told_apart(sensor_latency="load_step", frame_compliance="load_step")
    needs_sinkage = True
    at_start = (1.0,)

    def load(self, load: Scalar, situation: OnSoil) -> Scalar:
        return load - np.minimum(self.friction, np.maximum(load, 0.0)) * self._direction(situation)

    def remember(self, memory: Recall, step: float, situation: OnSoil) -> Recall:
        moved = float(situation.sinking) * step / self.travel
        return (turned_round(memory[0], moved, self.exponent),)

    def _direction(self, situation: OnSoil) -> Scalar:
        """s, −1 after rising … 1 after sinking."""
        if self.name in situation.memory:
            return situation.memory[self.name][0]
        assert situation.sinkage is not None  # by needs_sinkage
        return run_by_run(self._turning, situation.run, situation.time, situation.sinkage)

    def _turning(self, time: Array, sinkage: Array) -> Array:
        return presliding(smoothed(time, sinkage), self.travel, self.exponent)
