"""The frame yields under load."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Loaded, Sensed


@dataclass(frozen=True)
class FrameCompliance(Effect):
    """The rig yields under load and the potentiometer reads it as sinkage.

    z_read = z + C W

    Source: linear elasticity; the testbed of Pavlov and Johnson (Carnegie Mellon) yields 0.0125
    mm/N when it presses on a rigid stop.
    """

    compliance: float = strength("yielding per load, C", "m/N", typical=1.5e-5, low=0.0, high=0.001)

    stage = "testbed"
    fingerprint = Fingerprint(
        "sinkage", "load", "sinkage reads too large in proportion to load; nothing when lifted"
    )
    confusable_with = told_apart(
        sinkage_gain="dead_weight", sinkage_datum="load_step", rear_contact="dead_weight"
    )

    def sensors(self, sensed: Sensed, situation: Loaded) -> Sensed:
        return replace(sensed, sinkage=sensed.sinkage + self.compliance * situation.carried)

    def correct(self, sensed: Sensed, situation: Loaded) -> Sensed:
        return replace(sensed, sinkage=sensed.sinkage - self.compliance * situation.carried)
