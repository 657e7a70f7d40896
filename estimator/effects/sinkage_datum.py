"""Zero of the sinkage potentiometer."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Sensed, Situation


@dataclass(frozen=True)
class SinkageDatum(Effect):
    """The potentiometer's zero is not the soil surface.

    z_read = z + z₀

    Source: calibration model. A wheel that is zeroed while it rests on the soil hides its static
    sinkage this way.
    """

    offset: float = strength(
        "reading on the undisturbed surface, z₀", "m", typical=2e-3, low=-0.1, high=0.1
    )

    stage = "sensor"
    free_along = ("run",)
    fingerprint = Fingerprint(
        "sinkage", "constant", "sinkage off by the same amount everywhere, also when lifted"
    )
    confusable_with = told_apart(
        sinkage_gain="load_step", frame_compliance="load_step", bed_slope="level"
    )

    def sensors(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(sensed, sinkage=sensed.sinkage + self.offset)

    def correct(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(sensed, sinkage=sensed.sinkage - self.offset)
