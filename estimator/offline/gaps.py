"""Where a recording is silent: a gap is a gap, and takes neither time nor memory."""

from __future__ import annotations

import numpy as np

from gritd.estimator.compiled.arithmetic import integer_sum
from gritd.estimator.limits import limits, raised
from gritd.estimator.messages.readings import NS
from gritd.estimator.offline.windows import Ints
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.terramechanics.soil import Array

GAP = 10 * NS  # [ns] of silence after which there are no ticks until the next reading
MARGIN = 20  # points of a grid left in a gap on either side, so that no line is fitted across it


def tick_after(start: int, period: int, time: int) -> int:
    """The first tick at `time` or later [ns], of those every `period` from `start`."""
    return start + -((start - time) // period) * period


def built_ticks(received: Ints, period: int) -> Ints:
    """Ticks [ns] every `period` [ns] from the first to the last reading (n,), received in this
    order; where nothing is received for longer than GAP, they end and begin anew with the next
    reading.

    Raises RecordingError where there are more than the limit.
    """
    if not received.size:
        return np.empty(0, np.int64)

    start, breaks = int(received[0]), np.flatnonzero(np.diff(received) > GAP)
    first = [start, *(tick_after(start, period, int(t)) for t in received[breaks + 1])]
    last = [
        *(tick_after(start, period, int(t) + GAP) for t in received[breaks]),
        tick_after(start, period, int(received[-1])),
    ]
    check_ticks(integer_sum((b - a) // period + 1 for a, b in zip(first, last, strict=True)))

    stretches = [np.arange(a, b + 1, period) for a, b in zip(first, last, strict=True)]
    return np.unique(np.concatenate(stretches))


def check_ticks(count: int) -> None:
    """Raises RecordingError where these are more than the limit."""
    most = limits().ticks
    if count > most:
        raise RecordingError(f"its readings fill more than {most:.0f} ticks; {raised('ticks')}")


def edges_of(beats: Array, start: float, end: float, rate: float) -> Array:
    """Edges (n + 1,) [s] of a grid of `rate` [Hz] from start to end. The middle of every silence
    longer than GAP is one interval, wide and empty.

    beats: times (m,) [s] of the readings that the grid is for, ascending. Raises RecordingError
    where the grid has more points than the limit.
    """
    count = int((end - start) * rate)
    beats = beats[(beats >= start) & (beats <= end)]
    gaps = np.flatnonzero(np.diff(beats) > max(GAP / NS, (2 * MARGIN + 2) / rate))
    first = np.ceil((beats[gaps] - start) * rate) + MARGIN
    last = np.floor((beats[gaps + 1] - start) * rate) - MARGIN

    bounds = [0.0, *np.column_stack((first, last)).ravel().tolist(), float(count)]
    stretches = list(zip(bounds[::2], bounds[1::2], strict=True))
    most = limits().grid
    if integer_sum(b - a + 1 for a, b in stretches) > most:
        raise RecordingError(f"its readings fill more than {most:.0f} points; {raised('grid')}")

    return start + np.concatenate([np.arange(a, b + 1) for a, b in stretches]) / rate
