"""Compaction over repeated passes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics.soil import Soil


@dataclass(frozen=True)
class Multipass(Effect):
    """Each pass over the same rut leaves the soil denser: stiffer, and stronger in shear.

    K · (1 + a g),  c · (1 + a_c g),  k / (1 + a_k g),   g = 1 − e^(−(N − 1)/N₀) on the N-th pass

    Source: Wong (2008), Theory of Ground Vehicles, 4th ed., section 2.4.2 (repetitive loading);
    saturating growth after Holm (1969), Proc. 3rd ISTVS Conf., and Senatore and Sandu (2011), J.
    Terramechanics 48, 265-276.
    """

    stiffening: float = strength("final rise of K, a", "", typical=0.5, low=0.0, high=5.0)
    bonding: float = strength("final rise of c, a_c", "", typical=0.3, low=0.0, high=3.0)
    shortening: float = strength(
        "final fall of k as 1/(1 + a_k)", "", typical=0.2, low=0.0, high=2.0
    )
    passes: float = shape(
        "passes to 63 % of the growth, N₀", "", mean=2.0, sigma=1.0, low=0.5, high=10.0
    )

    stage = "soil"
    fingerprint = Fingerprint("sinkage", "run", "sinkage falls from pass to pass, fast at first")
    confusable_with = told_apart(
        drying_cohesion="second_pass", soil_patch="second_pass", sinkage_datum="tape"
    )

    def soil(self, soil: Soil, situation: Situation) -> Soil:
        grown = 1.0 - np.exp((1.0 - situation.pass_number) / self.passes)
        return replace(
            soil,
            modulus=soil.modulus * (1.0 + self.stiffening * grown),
            cohesion=soil.cohesion * (1.0 + self.bonding * grown),
            shear_modulus=soil.shear_modulus / (1.0 + self.shortening * grown),
        )
