"""Scale of the sinkage potentiometer."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Sensed, Situation


@dataclass(frozen=True)
class SinkageGain(Effect):
    """The potentiometer's scale is off by a factor.

    z_read = (1 + g) z

    Source: calibration model. It acts after the datum, on all that the potentiometer moves.
    """

    gain: float = strength("relative error of the scale, g", "", typical=0.05, low=-0.8, high=2.0)

    stage = "sensor"
    fingerprint = Fingerprint("sinkage", "sinkage", "sinkage off in proportion to itself")
    confusable_with = told_apart(
        frame_compliance="dead_weight", sinkage_datum="load_step", slip_sinkage="tape"
    )

    def sensors(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(sensed, sinkage=sensed.sinkage * (1.0 + self.gain))

    def correct(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(sensed, sinkage=sensed.sinkage / (1.0 + self.gain))
