"""Zeros that creep."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.situation import Sensed, Situation


@dataclass(frozen=True)
class SensorDrift(Effect):
    """The zero of a channel creeps while its electronics warm up.

    y_read = y + d (1 − e^(−t/τ)), each channel its own d

    Source: first-order warm-up of a strain-gauge or potentiometer bridge, Doebelin (2004),
    Measurement Systems, 5th ed., section 3.3 (zero drift). t runs from the first recording of the
    campaign; where τ is much longer, the drift is a straight line of slope d/τ.
    """

    sinkage: float = strength(
        "creep of the potentiometer's zero", "m", typical=5e-4, low=-0.02, high=0.02
    )
    current: float = strength("creep of the shunt's zero", "A", typical=0.03, low=-2.0, high=2.0)
    drawbar_pull: float = strength(
        "creep of the drawbar pull's zero", "N", typical=2.0, low=-50.0, high=50.0
    )
    vertical_load: float = strength(
        "creep of the load's zero", "N", typical=1.5, low=-50.0, high=50.0
    )
    axle_torque: float = strength(
        "creep of the axle torque's zero", "N·m", typical=0.05, low=-5.0, high=5.0
    )
    duration: float = shape(
        "time to 63 % of the creep, τ", "s", mean=600.0, sigma=400.0, low=5.0, high=7200.0
    )

    stage = "sensor"
    free_along = ("time", "run")
    fingerprint = Fingerprint(
        "drawbar_pull", "time", "one channel's zero moves, at rest and in the air too"
    )
    confusable_with = told_apart(
        drying_cohesion="lifted_spin", motor_heating="standstill", current_offset="long_run"
    )

    def sensors(self, sensed: Sensed, situation: Situation) -> Sensed:
        return self._moved(sensed, situation, 1.0)

    def correct(self, sensed: Sensed, situation: Situation) -> Sensed:
        return self._moved(sensed, situation, -1.0)

    def _moved(self, sensed: Sensed, situation: Situation, sign: float) -> Sensed:
        crept = -sign * np.expm1(-np.asarray(situation.time) / self.duration)
        return replace(
            sensed,
            sinkage=sensed.sinkage + self.sinkage * crept,
            current=sensed.current + self.current * crept,
            drawbar_pull=sensed.drawbar_pull + self.drawbar_pull * crept,
            load=sensed.load + self.vertical_load * crept,
            torque=sensed.torque + self.axle_torque * crept,
        )
