"""Carriage travel that its encoder does not see."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Wheel


@dataclass(frozen=True)
class PulleySlip(Effect):
    """The carriage belt slips on the encoder's pulley, so the carriage travels farther than its
    encoder counts.

    v = (1 + s) v_read,   x = (1 + s) x_read

    Source: elastic creep of a belt drive, Johnson (1985), Contact Mechanics, chapter 8: a share of
    the travel.
    """

    share: float = strength("travel not seen, s", "", typical=0.03, low=-0.1, high=0.4)

    stage = "sensor"
    fingerprint = Fingerprint(
        "drawbar_pull",
        "slip",
        "drawbar pull and torque too low, most where slip is low and its error counts most",
    )
    confusable_with = told_apart(wheel_radius_error="tape", torque_constant_error="slip_step")

    def motion(self, motion: Motion, wheel: Wheel) -> Motion:
        travelled = 1.0 + self.share
        return replace(
            motion,
            carriage_speed=motion.carriage_speed * travelled,
            carriage_position=motion.carriage_position * travelled,
        )
