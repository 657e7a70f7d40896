"""The bed is not level."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Reaction, Situation
from gritd.estimator.terramechanics.soil import Scalar


@dataclass(frozen=True)
class BedSlope(Effect):
    """The bed is tilted, so a share of the weights acts along the drawbar pull.

    W cos α on the soil;   DP − W sin α, α positive uphill

    Source: statics. The frame is taken to be level, the soil surface tilted.
    """

    angle: float = strength("slope, uphill positive, α", "rad", typical=0.02, low=-0.35, high=0.35)

    stage = "testbed"
    fingerprint = Fingerprint(
        "drawbar_pull", "load", "drawbar pull lower by a fixed share of the load, either way driven"
    )
    confusable_with = told_apart(
        force_crosstalk="level",
        side_wall_rubbing="reversal",
        bulldozing="reversal",
        sinkage_datum="level",
    )

    def load(self, load: Scalar, situation: Situation) -> Scalar:
        return load * float(np.cos(self.angle))

    def testbed(self, reaction: Reaction, situation: Situation) -> Reaction:
        return replace(
            reaction, drawbar_pull=reaction.drawbar_pull - situation.load * np.sin(self.angle)
        )
