"""Which windows a recorded run has, where the configuration leaves their length open: the choice
that the pipeline made on line (wheel/window_choice.py), from arrays.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.offline.snapshots import encoder_samples, snapshots
from gritd.estimator.offline.streams import RecordedStreams
from gritd.estimator.offline.windows import Ints
from gritd.estimator.wheel.sync import window_at_first
from gritd.estimator.wheel.window_choice import driving, window_of


class Windows(NamedTuple):
    """Windows of one length."""

    ends: Ints  # (m,) numbers of the ticks that end one
    length: int  # [ns]
    choosing: bool = False  # whether the length is one from which another is chosen


def windows(settings: Settings, streams: RecordedStreams) -> list[Windows]:
    """The windows of a run: those from which a length is chosen, if any, and then the others."""
    first = window_at_first(settings)
    ends = window_ends(streams.ticks, first)
    if not settings.rates.auto:
        return [Windows(ends, first)]

    before = None
    for place, now in enumerate(snapshots(settings, streams, ends, first)):
        if driving(now, before):
            tick = int(ends[place])
            length = window_of(settings, now, encoder_samples(settings, streams, tick, first))
            after = Windows(_after(streams.ticks, tick, first, length), length)
            return [Windows(ends[: place + 1], first, True), after]
        before = now
    return [Windows(ends, first, True)]


def window_length(settings: Settings, streams: RecordedStreams) -> int:
    """Length of the windows [ns] that the filter uses."""
    return windows(settings, streams)[-1].length


def window_ends(ticks: Ints, length: int) -> Ints:
    """Numbers (m,) of the ticks (k,) [ns] that end a window of `length` [ns]: the first, then each
    that comes a window later.
    """
    return np.array(list(_ends(ticks, length)), dtype=np.int64)


def _ends(ticks: Ints, length: int) -> Iterator[int]:
    following = 0
    while following < len(ticks):
        yield following
        following = bisect_left(ticks, ticks[following] + length, following)


def _after(ticks: Ints, tick: int, before: int, length: int) -> Ints:
    """Numbers of the ticks that end windows of `length` [ns] after a tick that ended one of another
    length, `before` [ns]: a window is done when its centre is a length on.
    """
    due = int(ticks[tick]) + length + length // 2 - before // 2
    first = max(tick + 1, int(np.searchsorted(ticks, due)))
    return first + window_ends(ticks[first:], length)
