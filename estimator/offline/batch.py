"""A whole recording at once: the estimates the loop made of it, hundreds of times faster than it
was recorded.

The filter is updated at window ends only; the ticks in between publish. So the estimates of a
recording need one snapshot a window, and those come from arrays (snapshots.py). From there on the
tracker is that of the live loop.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import nan
from struct import Struct
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.compiled.arithmetic import integer_sum
from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.account import Account, aids, health, measurements, soil_estimate
from gritd.estimator.filter.bank import Bank, reported
from gritd.estimator.filter.estimate import Estimate
from gritd.estimator.filter.reasons import Reason, withheld
from gritd.estimator.filter.segments import Memory
from gritd.estimator.filter.track import TrackState
from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.messages.tick import (
    TICK_FIELDS,
    Aid,
    FilterHealth,
    Measurements,
    SoilEstimate,
    names_of,
    row,
)
from gritd.estimator.offline.run_window import Windows, windows
from gritd.estimator.offline.snapshots import snapshots
from gritd.estimator.offline.streams import RecordedStreams, recorded_streams
from gritd.estimator.online.bed import RunStart, begun
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.wheel.sync import Snapshot

Table = NDArray[np.void]  # structured

AT_ONCE = 100_000  # windows that are looked at together
ROWS = 5_000  # that are numbers of Python at a time: they take ten times their place in an array
_KINDS = {"float64": "<f8", "bool": "?"}
_CODES = {"<f8": "d", "?": "?", "<i8": "q"}  # of struct
_DTYPES = {name: _KINDS.get(kind, "<i8") for name, kind, _ in TICK_FIELDS}


class WindowHead(NamedTuple):
    """Of `tick.Head` what belongs to a window."""

    evaluated: int
    status: int
    flags: int
    stale: int
    stuck: int


class PointPredictions(NamedTuple):
    """Of `tick.Predictions` what needs no standard deviations; NaN where nothing is touched."""

    torque_predicted: float = nan
    drawbar_pull_predicted: float = nan
    rolling_resistance: float = nan


class BatchWindow(NamedTuple):
    """What is kept of one window: blocks and names of `Tick`."""

    head: WindowHead
    measurements: Measurements
    soil: SoilEstimate
    predictions: PointPredictions
    health: FilterHealth
    torque: Annotated[Aid, "N·m"]
    drawbar_pull: Annotated[Aid, "N"]


ESTIMATES = names_of(BatchWindow)
_WINDOW_DTYPE = np.dtype([(name, _DTYPES[name]) for name in ESTIMATES])
# a row as bytes of the table: numpy takes four times as long for a tuple
_PACK = Struct("<" + "".join(_CODES[_DTYPES[name]] for name in ESTIMATES)).pack


class Replayed(NamedTuple):
    """What the filter made of a recording."""

    rows: Table  # one a window (n,), fields ESTIMATES, each as in /tick
    bank: Bank  # at the end
    memory: Memory  # likewise
    reason: Reason  # why what it leaves is not believed

    @property
    def believed(self) -> bool:
        """Whether what the run leaves is believed, of all that it showed."""
        return not self.reason.why

    @property
    def estimate(self) -> Estimate:
        """At the end: what the members of the bank say together."""
        return reported(self.bank)


def estimates(settings: Settings, recording: Recording, engine: str = "plain") -> Table:
    """What the filter makes of a recording: one row a window (n,), fields ESTIMATES; see
    `replayed`. Raises RecordingError.
    """
    return replayed(settings, recording, engine).rows


def replayed(
    settings: Settings,
    recording: Recording,
    engine: str = "plain",
    start: RunStart | None = None,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> Replayed:
    """What the filter makes of a recording, begun with the stated prior or with `start`. See
    `followed`. Raises RecordingError.
    """
    streams = recorded_streams(recording, settings.rates.tick)

    return followed(settings, streams, engine, start, advance)


def followed(
    settings: Settings,
    streams: RecordedStreams,
    engine: str = "plain",
    start: RunStart | None = None,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> Replayed:
    """What the filter makes of readings, window by window.

    The windows are those the loop updated the filter at: by the recording's own ticks where it has
    them, else by ticks at the configured rate. Of `flags`, those that concern single ticks (late
    readings, counter jumps) are left out. `advance` is given after each window how many are done
    and how many there are.
    """
    pipeline = Pipeline(settings, engine)
    tracker, settings = pipeline.tracker, pipeline.settings
    state = tracker.start()
    state = state if start is None else begun(state, start)
    tables = [np.empty(0, _WINDOW_DTYPE)]

    rows: list[bytes] = []
    every = windows(settings, streams)
    total, done = integer_sum(len(part.ends) for part in every), 0
    for part in every:
        state = state._replace(window=part.length, choosing=part.choosing)
        for snapshot in _snapshots(settings, streams, part):
            state, account = tracker.step(state, snapshot)
            rows.append(_PACK(*row(_window(tracker, state, account))))
            done += 1
            if done % ROWS == 0 or done == total:
                tables.append(np.frombuffer(b"".join(rows), _WINDOW_DTYPE))
                rows = []
            advance(done, total)

    state = tracker.concluded(state)
    return Replayed(
        np.concatenate(tables),
        state.bank,
        state.memory,
        withheld(tracker, state),
    )


def _snapshots(settings: Settings, streams: RecordedStreams, part: Windows) -> Iterator[Snapshot]:
    """What each window shows; so many at once."""
    for begin in range(0, len(part.ends), AT_ONCE):
        ends = part.ends[begin : begin + AT_ONCE]
        yield from snapshots(settings, streams, ends, part.length)


def _window(tracker: Tracker, state: TrackState, account: Account) -> BatchWindow:
    """One window, after its update."""
    snapshot = account.snapshot
    torque, drawbar_pull = aids(account)

    return BatchWindow(
        head=WindowHead(
            evaluated=snapshot.evaluated,
            status=account.status,
            flags=account.flags,
            stale=snapshot.stale,
            stuck=snapshot.stuck,
        ),
        measurements=measurements(snapshot, account.now),
        soil=soil_estimate(account.estimate),
        predictions=_predictions(tracker, state, account),
        health=health(state, account),
        torque=torque,
        drawbar_pull=drawbar_pull,
    )


def _predictions(tracker: Tracker, state: TrackState, account: Account) -> PointPredictions:
    """At the estimate after the update."""
    if not account.touching:
        return PointPredictions()

    measurement, estimate, now = tracker.measurement, account.estimate, account.now
    prediction = measurement.predict(estimate, now)
    shared = measurement.shared(now, prediction, state.by_parameters)
    torque, pull = measurement.expected(estimate, prediction, shared)
    return PointPredictions(
        torque_predicted=torque,
        drawbar_pull_predicted=pull,
        rolling_resistance=prediction.resistance.value,
    )
