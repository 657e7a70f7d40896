"""Zero of the current measurement."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Sensed, Situation


@dataclass(frozen=True)
class CurrentOffset(Effect):
    """The shunt amplifier reads a current where there is none.

    I_read = I + I₀

    Source: calibration model (input offset of the amplifier).
    """

    offset: float = strength("reading at zero current, I₀", "A", typical=0.1, low=-2.0, high=2.0)

    stage = "sensor"
    fingerprint = Fingerprint(
        "torque", "constant", "current shifted by the same amount always, at standstill too"
    )
    confusable_with = told_apart(coulomb_friction="standstill", asymmetric_friction="standstill")

    def sensors(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(sensed, current=sensed.current + self.offset)

    def correct(self, sensed: Sensed, situation: Situation) -> Sensed:
        return replace(sensed, current=sensed.current - self.offset)
