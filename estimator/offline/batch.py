"""A whole recording at once: the estimates the loop made of it, hundreds of times faster than it
was recorded.

The filter is updated at window ends only; the ticks in between publish. So the estimates of a
recording need one snapshot a window, and those come from arrays (snapshots.py). From there on the
tracker is that of the live loop.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.account import (
    AIDED,
    ESTIMATED,
    HEALTH,
    MEASURED,
    Row,
    aided,
    estimated,
    health,
    measured,
)
from gritd.estimator.filter.tracker import Account, Tracker, TrackState
from gritd.estimator.messages.readings import NS
from gritd.estimator.messages.record import NOT_A_NUMBER, TICK_FIELDS
from gritd.estimator.offline.snapshots import Ints, played, snapshots
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.wheel.wheel_state import wheel_state

Table = NDArray[np.void]  # structured

STATE = ("evaluated", "status", "flags", "stale", "stuck")
PREDICTED = ("torque_predicted", "drawbar_pull_predicted", "rolling_resistance")
ESTIMATES = (*STATE, *MEASURED, *ESTIMATED, *PREDICTED, *HEALTH, *AIDED)
SIGNALS = ("evaluated", "stale", "stuck", *MEASURED)
_KINDS = {"float64": "<f8", "bool": "?"}
_DTYPES = {name: _KINDS.get(kind, "<i8") for name, kind, _ in TICK_FIELDS}


def estimates(settings: Settings, recording: Recording, engine: str = "plain") -> Table:
    """What the filter makes of a recording: one row a window, shape (n,), fields ESTIMATES, each as
    in /tick.

    The windows are those the loop updated the filter at: by the recording's own ticks where it has
    them, else by ticks at the configured rate. Of `flags`, those that concern single ticks (late
    readings, counter jumps) are left out. Raises RecordingError.
    """
    pipeline = Pipeline(settings, engine)
    replayed = played(recording, pipeline.settings.rates.tick)
    chosen = window_ends(replayed.ticks, round(NS / pipeline.settings.rates.update))
    tracker = pipeline.tracker
    state, rows = tracker.start(), []
    for snapshot in snapshots(pipeline.settings, replayed, chosen):
        state, account = tracker.step(state, snapshot)
        rows.append(_row(tracker, state, account))
    return _table(ESTIMATES, rows)


def signals(settings: Settings, recording: Recording, every_tick: bool = False) -> Table:
    """What the sensors say of the wheel, without a filter: shape (n,), fields SIGNALS, each as in
    /tick.

    One row a window, which share no reading; or one a tick, from overlapping windows.
    """
    replayed = played(recording, settings.rates.tick)
    all_ticks = np.arange(len(replayed.ticks))
    chosen = (
        all_ticks if every_tick else window_ends(replayed.ticks, round(NS / settings.rates.update))
    )
    rows = [
        (s.evaluated, s.stale, s.stuck, *measured(s, wheel_state(settings, s)))
        for s in snapshots(settings, replayed, chosen)
    ]
    return _table(SIGNALS, rows)


def window_ends(ticks: Ints, length: int) -> Ints:
    """Numbers of the ticks that end a window of `length` [ns]: the first, then each that comes a
    window later.
    """
    stamps, ends, following = ticks.tolist(), [], 0
    while following < len(stamps):
        ends.append(following)
        following = bisect_left(stamps, stamps[following] + length, following)
    return np.array(ends, dtype=np.int64)


def _row(tracker: Tracker, state: TrackState, account: Account) -> Row:
    """In the order of ESTIMATES."""
    snapshot = account.snapshot
    return (
        snapshot.evaluated,
        account.status,
        account.flags,
        snapshot.stale,
        snapshot.stuck,
        *measured(snapshot, account.now),
        *estimated(state.estimate),
        *_predicted(tracker, state, account),
        *health(tracker, state),
        *aided(account.aids),
    )


def _predicted(tracker: Tracker, state: TrackState, account: Account) -> Iterable[float]:
    """T, DP and resistance at the estimate after the update."""
    if not account.touching:
        return (NOT_A_NUMBER,) * len(PREDICTED)
    return [quantity.value for quantity in tracker.measurement.predict(state.estimate, account.now)]


def _table(names: Sequence[str], rows: list[Row]) -> Table:
    return np.array(rows, dtype=[(name, _DTYPES[name]) for name in names])
