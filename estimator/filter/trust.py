"""Whether the filter's estimate is to be believed, from its innovations.

What a change of the soil explains is taken care of first (change.py). What then remains is judged
here: σ is set back to the prior's where model and measurement disagree by more than the reset
threshold, and doubled if that does not help.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, inf, nan
from typing import NamedTuple

from gritd.estimator.filter.estimate import Vector
from gritd.estimator.filter.tuning import CHANGE, TRUST
from gritd.estimator.messages.replacing import quickly_replaced
from gritd.estimator.messages.status import Status
from gritd.estimator.messages.tick import Aid


@quickly_replaced
class Trust(NamedTuple):
    """What is remembered to judge the estimate by. Times are of driving, from update to update."""

    surprise: Vector = (0.0, 0.0)  # of torque and drawbar pull: normalised innovations squared …
    components: float = 0.0  # … and their number, both summed and exponentially forgotten
    since_change: float = inf  # [s] since σ was widened for a change of the soil
    changes: float = 0.0  # number of them, exponentially forgotten
    since_reset: float = inf  # [s]
    streak: int = 0  # resets in a row
    doubts: int = 0  # of them, because the equations missed the record
    missing: float = 0.0  # [s] for which the equations have missed it
    at_bound: float = 0.0  # [s] for which the estimate has stood at an improbable bound

    @property
    def consistency(self) -> float:
        """Mean normalised innovation squared per component; 1 when the stated noise is the real
        one.
        """
        torque, drawbar_pull = self.surprise
        return (torque + drawbar_pull) / self.components if self.components > 0.0 else nan

    def passed(self, elapsed: float, missing: bool = False) -> Trust:
        """An update later; missing: whether the equations miss the record."""
        return self._replace(
            since_change=self.since_change + elapsed,
            since_reset=self.since_reset + elapsed,
            missing=self.missing + elapsed if missing else 0.0,
            changes=self.changes * exp(-elapsed / TRUST.restless_memory),
        )

    def surprised(self, aids: Sequence[Aid], passed: float, first: int = 0) -> Trust:
        """With the innovations of one more window; passed: the time since the last one, as a share
        of the memory; first: 1 where the torque is not measured.
        """
        keep = exp(-passed)
        squares = [min(aid.innovation**2 / aid.s, TRUST.most) for aid in aids]
        both = (*(0.0,) * first, *squares, 0.0)[: len(self.surprise)]
        surprise = tuple([keep * a + b for a, b in zip(self.surprise, both, strict=True)])
        return self._replace(surprise=surprise, components=keep * self.components + len(aids))

    def changed(self) -> Trust:
        """The soil changed: σ was widened."""
        return self._replace(
            surprise=(0.0, 0.0), components=0.0, since_change=0.0, changes=self.changes + 1.0
        )

    def reset(self) -> Trust:
        """σ was set back."""
        streak = self.streak + 1 if self.relapsing else 1
        return Trust(since_reset=0.0, streak=streak, doubts=self.doubts, changes=self.changes)

    @property
    def relapsing(self) -> bool:
        """Whether σ was set back so lately that once more would mean that the prior is too sure."""
        return self.since_reset < TRUST.relapse

    @property
    def doubt(self) -> float:
        """By how much the prior's σ is thought too small."""
        times = min(max(self.streak - 1, self.doubts), TRUST.widest)
        return TRUST.doubt**times if self.relapsing else 1.0

    @property
    def unrest(self) -> float:
        """Random walk of the soil after a change [prior σ/√s]: what changed may go on changing."""
        return CHANGE.walk * exp(-self.since_change / CHANGE.cooling)

    def disagrees(self, experienced: float) -> bool:
        """Whether neither one soil nor a change of it now and then explains what is measured.

        experienced: number of components on which the consistency has to rest.
        """
        inexplicable = self.components > experienced and self.consistency > TRUST.mismatch
        return inexplicable or self.changes > TRUST.restless

    def inconsistent(self, experienced: float) -> bool:
        """Whether σ has to be set back."""
        rested = self.since_reset > TRUST.patience and self.components > experienced
        return rested and self.consistency > TRUST.inconsistent

    def standing(self, experienced: float, separability: float) -> Status:
        """TRACKING, or why the estimate is not to be believed."""
        if self.at_bound > TRUST.at_bound:
            return Status.AT_BOUND
        again = self.relapsing and self.streak >= TRUST.diverged
        if again or separability > TRUST.wider:
            return Status.DIVERGED
        return Status.MISMATCH if self.disagrees(experienced) else Status.TRACKING
