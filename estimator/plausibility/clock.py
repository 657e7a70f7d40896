"""The clock of a run: how often its readings come, and where they do not; a wheel's angle that
wraps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.estimator.messages.readings import NS
from gritd.estimator.offline.windows import Ints
from gritd.estimator.terramechanics.soil import Array

LATE = 5.0  # usual intervals without a reading that are a gap
LEAP = 1000.0  # usual intervals: a unit of time that is another one
ENDS = 10  # readings at either end of a run that show a change of the interval


@dataclass(frozen=True)
class ReadingTimes:
    """When a channel was read; times [s]."""

    interval: float  # between two readings, the median
    duration: float
    gaps: int
    leap: float = 0.0  # the longest interval, where it is LEAP usual ones while the wheel moves …
    at: float = 0.0  # … and where it begins, from the first reading
    change: float = 1.0  # the interval at the end over that at the beginning


def clock_of(stamps: Ints, angle: Array) -> ReadingTimes:
    """stamps: of the wheel's readings (n,) [ns], ascending; angle: what they say (n,)."""
    steps = np.diff(stamps) / NS
    if not steps.size:
        return ReadingTimes(0.0, 0.0, 0)

    usual = float(np.median(steps))
    gaps = int(np.count_nonzero(steps > LATE * usual))
    duration = float(stamps[-1] - stamps[0]) / NS
    ends = steps[:ENDS], steps[-ENDS:]
    change = float(np.median(ends[1]) / max(np.median(ends[0]), 1.0 / NS))

    longest = int(np.argmax(steps))
    if steps[longest] < LEAP * usual or not _moves_around(angle, longest):
        return ReadingTimes(usual, duration, gaps, change=change)
    at = float(stamps[longest] - stamps[0]) / NS
    return ReadingTimes(usual, duration, gaps, float(steps[longest]), at, change)


def _moves_around(angle: Array, place: int) -> bool:
    """Whether the wheel turns right before and right after the step that begins at a place."""
    before, after = angle[max(place - ENDS, 0) : place + 1], angle[place + 1 : place + 2 + ENDS]
    return all(part.size > 1 and part[0] != part[-1] for part in (before, after))


def wrap_of(angle: Array) -> float:
    """By how much the angle (n,) falls back, again and again or once, in one step against its
    motion; 0 where it does not. A step of more than half of all that it passes is no motion.
    """
    steps = np.diff(angle)
    moving = steps[steps != 0.0]
    if moving.size < ENDS:
        return 0.0

    forward = np.sign(np.median(moving))
    back = -forward * steps
    folds = back > 0.5 * np.ptp(angle)
    if forward == 0.0 or not folds.any():
        return 0.0
    return float(np.median(back[folds]) + np.abs(np.median(moving)))
