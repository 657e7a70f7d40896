"""The wheel or its carriage rubs on the wall of the bin."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gritd.estimator.effects.base import Effect, Fingerprint, strength, told_apart
from gritd.estimator.stages.situation import Balanced, Reaction


@dataclass(frozen=True)
class SideWallRubbing(Effect):
    """A sideways force presses the wheel on the bin's wall, and its friction takes from the drawbar
    pull.

    DP − s W, against the direction of travel

    The sideways force of a slightly skewed wheel is a share of W, its friction a share of that.
    Source: Daca, Tremblay, Skonieczny (2023), Microgravity Sci. Technol. 35:6, who add 0.25 of the
    sideways force.
    """

    share: float = strength("pull lost over load, s", "", typical=0.04, low=0.0, high=1.0)

    stage = "testbed"
    fingerprint = Fingerprint(
        "drawbar_pull", "load", "drawbar pull lost in proportion to load, always against travel"
    )
    confusable_with = told_apart(
        bed_slope="reversal", force_crosstalk="reversal", bulldozing="load_step"
    )

    def testbed(self, reaction: Reaction, situation: Balanced) -> Reaction:
        lost = self.share * situation.carried * situation.direction
        return replace(reaction, drawbar_pull=reaction.drawbar_pull - lost)
