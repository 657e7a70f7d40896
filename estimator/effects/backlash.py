"""Play in the drive."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.history import Bools, run_begins
from gritd.estimator.stages.situation import Balanced, Loaded
from gritd.estimator.terramechanics.soil import Array, Scalar

UNMOVED = 1e-12  # [rad] a smaller step is none


@dataclass(frozen=True)
class Backlash(Effect):
    """Gear and couplings have play: after a reversal the motor turns through the gap before it
    drives the wheel.

    T (1 − w),   w share of a step Δψ that passes inside the gap,   p ← p + Δψ kept within 0 … δ

    p is the place in the gap: δ where the teeth drive forward, as when the run begins, 0 where they
    drive backward. The impact at the end of the gap is left out, and so is the angle that the
    encoder counts in it. On line the few windows inside the gap are taken as they are.
    Source: play of a rigid gear, Nordin and Gutman (2002), Automatica 38, 1633-1649, section 2.
    """

    gap: float = strength("play at the axle, δ", "rad", typical=0.05, low=0.0, high=0.5)

    stage = "drivetrain"
    fingerprint = Fingerprint(
        "torque", "reversal", "no torque over the same angle after each reversal, then all of it"
    )
    confusable_with = told_apart(wheel_inertia="reversal", stribeck_friction="reversal")

    def torque_loss(self, situation: Loaded) -> Scalar:
        if not isinstance(situation, Balanced):  # on line
            return 0.0
        return -situation.torque * self._inside(situation)

    def _inside(self, situation: Balanced) -> Array:
        """w, 0 … 1."""
        angle = np.asarray(situation.wheel_angle)
        begins = run_begins(situation.run, angle.size)
        turned = np.where(begins, 0.0, np.diff(angle, prepend=angle[:1]))

        place = self._place(turned, begins)
        passed = np.where(begins, 0.0, np.abs(np.diff(place, prepend=self.gap)))
        return passed / np.maximum(np.abs(turned), UNMOVED)

    def _place(self, turned: Array, begins: Bools) -> Array:
        """p after each step [rad]."""
        steps = zip(turned.tolist(), begins.tolist(), strict=True)
        places = accumulate(
            steps,
            lambda p, step: self.gap if step[1] else min(max(p + step[0], 0.0), self.gap),
            initial=self.gap,
        )
        return np.fromiter(places, dtype=float)[1:]
