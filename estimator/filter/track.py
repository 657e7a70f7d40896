"""What the tracker remembers from window to window."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from gritd.estimator.filter.bank import Bank
from gritd.estimator.filter.estimate import Estimate, Vector
from gritd.estimator.filter.line import Line
from gritd.estimator.filter.measurement import ByParameters
from gritd.estimator.filter.segments import Memory, Stretch
from gritd.estimator.filter.trust import Trust
from gritd.estimator.messages.replacing import quickly_replaced
from gritd.estimator.messages.tick import Aid
from gritd.estimator.stages.situation import Recall
from gritd.estimator.wheel.wheel_state import Steady, WheelState


class Ended(NamedTuple):
    """A stretch has ended: it is to be completed."""

    same: bool  # the next is of the same condition, and the memory was linearised lately


class Judging(NamedTuple):
    """The record is to be judged."""

    same: bool


class Again(NamedTuple):
    """The soil seems to have changed: tangents at the best fit, so far, to judge the record by."""

    same: bool
    x: Vector
    lines: tuple[Line, ...] = ()


class Relining(NamedTuple):
    """The memory is linearised anew: its tangents so far."""

    x: Vector  # (d,) at which they are taken
    last: bool  # whatever the pass then finds, it is not linearised once more
    lines: tuple[Line, ...] = ()


class Passing(NamedTuple):
    """The filter runs over the memory that was linearised anew: the stretches it has been over."""

    x: Vector  # (d,)
    last: bool
    bank: Bank
    stretches: tuple[Stretch, ...] = ()


Task = Ended | Judging | Again | Relining | Passing


class Withheld(NamedTuple):
    """The innovations of the window whose review is under way. They count towards the trust in the
    estimate when it is complete: what a change of the soil explains is no surprise.
    """

    aids: tuple[Aid, ...]
    elapsed: float  # [s] of driving since the window before


@quickly_replaced
class TrackState(NamedTuple):
    """Everything the tracker remembers from window to window."""

    estimate: Estimate  # what the members of the bank say together
    base: Bank  # what the complete stretches leave
    bank: Bank  # and what they leave with the open one
    memory: Memory
    window: int  # [ns] length of a window
    choosing: bool  # whether that is one from which another length is to be chosen
    recall: Mapping[str, Recall]  # what configured effects remember, by name
    by_parameters: ByParameters  # of the last update
    linearised: Vector | None = None  # where the memory was linearised last
    unlinearised: int = 0  # windows since then
    began: int = -1  # end of the first window [ns]
    window_end: int = -1  # end of the last window looked at [ns]
    before: WheelState | None = None
    steady: Steady | None = None  # None where the last window was not ready
    misfit: float = 0.0  # probability that the equations miss, when a review was last complete
    misfit_at: int = 0  # which of the measured components was then the farthest off
    trust: Trust = Trust()
    updates: int = 0
    doubted: int = 0  # of `updates`, those after which the estimate was not believed
    resets: int = 0
    started: bool = False  # every required channel has filled a window once
    origin: float | None = None  # where the carriage stood in the first full window [m]
    task: Task | None = None  # of the review of the record that is under way
    withheld: Withheld | None = None  # likewise
    resets_flagged: int = 0  # of `resets`, those that a tick has flagged
