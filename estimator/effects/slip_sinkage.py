"""Sinkage that grows with slip."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Soil


@dataclass(frozen=True)
class SlipSinkage(Effect):
    """A slipping wheel digs soil out from under itself and sinks deeper.

    n = n₀ + n₁ |i|, in Eqs. (3) and (4)

    Source: Ding, Gao, Deng, Nagatani, Yoshida (2011), J. Terramechanics 48, 27-45, first order in
    i.
    """

    growth: float = strength(
        "rise of the exponent with slip, n₁", "", typical=0.2, low=-0.5, high=2.5
    )

    stage = "soil"
    fingerprint = Fingerprint("sinkage", "slip", "sinkage rises with slip at one load")
    confusable_with = told_apart(grousers="smooth_wheel", stress_peak_shift="penetration")

    def soil(self, soil: Soil, situation: Situation) -> Soil:
        return replace(soil, exponent=soil.exponent + self.growth * np.abs(situation.slip))
