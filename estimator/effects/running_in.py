"""A wheel that starts from where it rested."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.situation import Reaction, Situation


@dataclass(frozen=True)
class RunningIn(Effect):
    """A run begins in undisturbed soil: bow wave and slip-sinkage build up while the wheel moves on
    from there.

    DP + f W e,  z − d |i| e,   e = e^(−s/λ),   s travel since the run began

    Source: none published. A first-order approach to the steady state of Eqs. (1)-(10) over a
    length like that of the contact; the form was chosen here, after single-wheel trials that start
    from rest (MGST, docs/proof.md).
    """

    pull: float = strength(
        "drawbar pull beyond the steady one at the start, over the load, f",
        "",
        typical=0.06,
        low=0.0,
        high=1.0,
    )
    depth: float = strength(
        "slip-sinkage still wanting at the start, at slip 1, d",
        "m",
        typical=3e-3,
        low=0.0,
        high=0.05,
    )
    length: float = shape(
        "travel to 63 % of the steady state, λ", "m", mean=0.05, sigma=0.04, low=0.005, high=0.12
    )

    stage = "wheel"
    fingerprint = Fingerprint(
        "drawbar_pull",
        "position",
        "drawbar pull falls and the wheel sinks over the first decimetre of every run",
    )
    confusable_with = told_apart(
        soil_patch="shifted_start", drying_cohesion="shifted_start", motor_heating="shifted_start"
    )

    def wheel(self, reaction: Reaction, situation: Situation) -> Reaction:
        left = np.exp(-situation.travel / self.length)
        return replace(
            reaction,
            drawbar_pull=reaction.drawbar_pull
            + self.pull * left * situation.carried * situation.direction,
            sinkage=reaction.sinkage - self.depth * left * np.abs(situation.slip),
        )
