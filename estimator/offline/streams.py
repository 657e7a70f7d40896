"""The readings of a recording in arrays, each with the tick that consumed it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.messages.readings import CHANNELS, NS
from gritd.estimator.offline.gaps import built_ticks
from gritd.estimator.offline.windows import Ints
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.recording.tables import Fields
from gritd.estimator.recording.topics import TICK

RAW: dict[str, Fields] = {f"/raw/{channel}": None for channel in CHANNELS}
# What `recorded_streams` takes of a recording with ticks: given to `read`, it unpacks the file
# once.
STREAMS: dict[str, Fields] = {**RAW, TICK: ("stamp",)}


class Stream(NamedTuple):
    """Readings of one channel in the order in which they were consumed."""

    stamp: Ints  # (n,) [ns]
    received: Ints  # (n,) [ns]
    tick: Ints  # (n,) number of the tick that consumed it
    values: NDArray[Any]  # (n,) raw, or (n, 6) of the wrench


class RecordedStreams(NamedTuple):
    """The ticks of a recording and the readings each of them consumed, in
    arrays.
    """

    ticks: Ints  # (k,) [ns]
    streams: dict[str, Stream]


def recorded_streams(recording: Recording, rate: float) -> RecordedStreams:
    """Ticks as logged, else built at `rate` [Hz] from the first to the last receive time.

    Raises RecordingError where a raw topic is not what the contract says.
    """
    if not recording.counts[TICK]:
        return streams_at(recording, rate)

    tables = recording.tables(STREAMS)
    raw, logged = _raw(tables), tables[TICK]
    consumed = {name: np.searchsorted(logged["order"], rows["order"]) for name, rows in raw.items()}
    return _streams(logged["stamp"].copy(), raw, consumed)


def streams_at(recording: Recording, rate: float) -> RecordedStreams:
    """Ticks at `rate` [Hz] from the first to the last receive time, but for gaps, whatever was
    logged.
    """
    try:
        return streams_of(_raw(recording.tables(RAW)), rate)
    except RecordingError as error:
        raise RecordingError(f"{recording.path}: {error}") from None


def streams_of(raw: Mapping[str, NDArray[np.void]], rate: float) -> RecordedStreams:
    """Ticks at `rate` [Hz] over the readings of some channels: structured arrays (n,) with the
    fields stamp and log_time [ns] and those of the channel. Raises RecordingError for a gap that is
    too long.
    """
    raw = {name: rows[np.argsort(rows["log_time"], kind="stable")] for name, rows in raw.items()}
    received = [np.empty(0, np.int64), *(rows["log_time"] for rows in raw.values())]
    ticks = built_ticks(np.sort(np.concatenate(received)), round(NS / rate))

    consumed = {name: np.searchsorted(ticks, rows["log_time"]) for name, rows in raw.items()}
    return _streams(ticks, raw, consumed)


def _raw(tables: Mapping[str, NDArray[np.void]]) -> dict[str, NDArray[np.void]]:
    """The raw readings of every channel that has any."""
    raw = {channel: tables[f"/raw/{channel}"] for channel in CHANNELS}
    return {channel: rows for channel, rows in raw.items() if rows.size}


def _streams(
    ticks: Ints, raw: Mapping[str, NDArray[np.void]], consumed: Mapping[str, Ints]
) -> RecordedStreams:
    streams = {name: _stream(name, rows, consumed[name], len(ticks)) for name, rows in raw.items()}
    return RecordedStreams(ticks, streams)


def _stream(channel: str, rows: NDArray[np.void], tick: Ints, ticks: int) -> Stream:
    """What some tick consumed, ascending; readings after the last tick are left out."""
    end = int(np.searchsorted(tick, ticks))
    rows, tick = rows[:end], tick[:end]
    columns = [rows[name].copy() for name in CHANNELS[channel]]  # side by side, and rows can go
    return Stream(
        rows["stamp"].copy(),
        rows["log_time"].copy(),
        tick,
        columns[0] if len(columns) == 1 else np.stack(columns, axis=1),
    )
