"""A wheel that starts from where it rested."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.situation import Balanced, Reaction


@dataclass(frozen=True)
class RunningIn(Effect):
    """A run begins in undisturbed soil: bow wave and slip-sinkage build up while the wheel moves on
    from there.

    DP + f W e,  T (1 + t e),  z − (d |i| + q z) e,   e = e^(−s/λ),   s travel since the run began

    A wheel that rests is carried before and behind: half the load on either side makes q about 0.35
    by Eq. (1), n = 1.1. That torque and pull begin at nought where a recording begins at rest is
    `contact_relaxation`.
    Source: none published. A first-order approach to the steady state of Eqs. (1)-(10) over a
    length like that of the contact; the form was chosen here, after single-wheel trials that start
    from rest (MGST, docs/real-recordings.md).
    """

    pull: float = strength(
        "drawbar pull beyond the steady one at the start, over the load, f",
        "",
        typical=0.06,
        low=-1.0,
        high=1.0,
    )
    depth: float = strength(
        "slip-sinkage still wanting at the start, at slip 1, d",
        "m",
        typical=3e-3,
        low=0.0,
        high=0.05,
    )
    shallow: float = strength(
        "share of the sinkage still wanting at the start at any slip, q",
        "",
        typical=0.2,
        low=0.0,
        high=1.0,
    )
    torque: float = strength(
        "torque beyond the steady one at the start, over the steady one, t",
        "",
        typical=0.2,
        low=-1.0,
        high=1.0,
    )
    length: float = shape(
        "travel to 63 % of the steady state, λ", "m", mean=0.05, sigma=0.04, low=0.002, high=0.3
    )

    stage = "wheel"
    every_run = True
    fingerprint = Fingerprint(
        "sinkage",
        "position",
        "the wheel sinks and drawbar pull falls over the first decimetre of every run",
    )
    confusable_with = told_apart(
        soil_patch="shifted_start", drying_cohesion="shifted_start", motor_heating="shifted_start"
    )

    def wheel(self, reaction: Reaction, situation: Balanced) -> Reaction:
        left = np.exp(-situation.travel / self.length)
        return replace(
            reaction,
            drawbar_pull=reaction.drawbar_pull
            + self.pull * left * situation.carried * situation.direction,
            torque=reaction.torque + self.torque * left * situation.torque,
            sinkage=reaction.sinkage
            - left * (self.depth * np.abs(situation.slip) + self.shallow * situation.sinkage),
        )
