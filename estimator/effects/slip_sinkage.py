"""Sinkage that grows with slip."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Reaction, Situation, dug_by_slip
from gritd.estimator.terramechanics.soil import Soil


@dataclass(frozen=True)
class SlipSinkage(Effect):
    """A slipping wheel digs soil out from under itself and sinks deeper.

    n = n₀ + n₁ |i|,   K (1 + s [(1 + |i|)/(1 − |i|/2) − 1])^−n₀,   z + d i/(1 − i)

    The first two change the contact, Eqs. (3) and (4); |i| counts up to 1 in the second. The last
    is a layer that slip carries away from under the wheel: the rut is deeper, the contact is the
    same.
    Source: Ding, Gao, Deng, Nagatani, Yoshida (2011), J. Terramechanics 48, 27-45, first order in
    i; Lyasko (2010), J. Terramechanics 47, 21-31, whose s is 1; i/(1 − i) is attributed to Reece
    (1965).
    """

    growth: float = strength(
        "rise of the exponent with slip, n₁", "", typical=0.2, low=0.0, high=2.5, stated=-0.5
    )

    deepening: float = strength(
        "growth of the sinkage with slip, 1 in Lyasko's law, s", "", typical=0.3, low=0.0, high=4.0
    )

    digging: float = strength(
        "height of the soil that slip carries away, d", "m", typical=2e-3, low=0.0, high=0.06
    )

    stage = "soil"
    fingerprint = Fingerprint("sinkage", "slip", "sinkage rises with slip at one load")
    confusable_with = told_apart(grousers="smooth_wheel", stress_peak_shift="penetration")

    def soil(self, soil: Soil, situation: Situation) -> Soil:
        slip = np.minimum(np.abs(situation.slip), 1.0)
        deeper = 1.0 + self.deepening * ((1.0 + slip) / (1.0 - 0.5 * slip) - 1.0)
        return replace(
            soil,
            exponent=soil.exponent + self.growth * np.abs(situation.slip),
            modulus=soil.modulus * deeper ** (-soil.exponent),
        )

    def wheel(self, reaction: Reaction, situation: Situation) -> Reaction:
        dug = self.digging * dug_by_slip(situation.slip)
        return replace(reaction, sinkage=reaction.sinkage + dug)
