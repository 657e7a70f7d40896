"""A wheel that starts from where it rested."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, shape, strength, told_apart
from gritd.estimator.stages.situation import Balanced, Reaction
from gritd.estimator.terramechanics.soil import Scalar

FIRST = 1e-9  # of the order beyond 1 that is exponential
SPENT = 1e-12  # least share of the soil to come, so that logarithms stay finite


@dataclass(frozen=True)
class RunningIn(Effect):
    """A run begins in undisturbed soil: bow wave and slip-sinkage build up while the wheel moves on
    from there.

    DP + (f W + t T/r) e,  T (1 + t e),  z − (d |i| + q z) e,
    e = [1 + (e^(m−1) − 1) s/λ]^(−1/(m−1)),  e^(−s/λ) for m = 1,   s travel since the run began

    What is still wanting falls with its own mth power, de/ds ~ −e^m, and is a factor e less after λ
    at any m: a straight line for m = 0, where a rut of a given size is filled at an even rate, the
    exponential for m = 1, a hyperbola for m = 2, whose last remainder takes long. A heap before the
    wheel only takes from the pull, so that f is not negative; what the rim shears more in soil that
    is not yet sheared, it also pushes with. A wheel that rests is carried before and behind: half
    the load on either side makes q about 0.35 by Eq. (1), n = 1.1. That torque and pull begin at
    nought where a recording begins at rest is `contact_relaxation`.
    Source: hyperbola Kondner (1963), J. Soil Mech. Found. Div. ASCE 89(SM1), 115-143; exponential
    Janosi and Hanamoto (1961); kinetics of order m Mewis and Wagner (2009), Adv. Colloid Interface
    Sci. 147-148, 214-227, there of structure that shear breaks down. That a wheel's steady state
    comes by these laws was chosen here, after single-wheel trials that start from rest (MGST,
    docs/real-recordings.md).
    """

    pull: float = strength(
        "drawbar pull beyond the steady one at the start, over the load, f",
        "",
        typical=0.06,
        low=0.0,
        high=1.0,
        stated=-1.0,
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
    order: float = shape(
        "power of what is wanting by which it falls, m", "", mean=1.0, sigma=0.5, low=0.0, high=2.0
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
        left = self._left(situation.travel)
        sheared = self.torque * left * situation.torque
        heap = self.pull * left * situation.carried * situation.direction
        return replace(
            reaction,
            drawbar_pull=reaction.drawbar_pull + heap + sheared / situation.radius,
            torque=reaction.torque + sheared,
            sinkage=reaction.sinkage
            - left * (self.depth * np.abs(situation.slip) + self.shallow * situation.sinkage),
        )

    def _left(self, travel: Scalar) -> Scalar:
        """What is still wanting (n,), of 1, after a travel (n,) [m]."""
        beyond = self.order - 1.0 if abs(self.order - 1.0) > FIRST else FIRST
        filled = np.expm1(beyond) * travel / self.length
        left: Scalar = np.exp(-np.log1p(np.maximum(filled, -1.0 + SPENT)) / beyond)
        return left
