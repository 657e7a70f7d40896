"""From a rig's arrays to a recording: the same readings a daemon would have logged, in the order of
their stamps.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template

import numpy as np
from numpy.typing import NDArray

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.messages.readings import CHANNELS
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.mcapfile import reported
from gritd.estimator.recording.run_writer import RunWriter
from gritd.tools.cli.command import USAGE
from gritd.tools.cli.progress import Progress
from gritd.tools.importers.files import Array, RigFileError

NS = 1_000_000_000
STEP = 10_000  # readings of a channel that are written at once
UNKNOWN = 1e6  # standard deviation, in N or N·m, of what a rig does not measure: no information


@dataclass(frozen=True)
class ChannelReadings:
    """The readings of one channel: stamps [ns since the epoch] that rise, shape (n,); raw values,
    shape (n,), wrench (n, 6).
    """

    channel: str
    stamps: NDArray[np.int64]
    values: NDArray[np.int64] | Array


def stamps(start: int, seconds: Array) -> NDArray[np.int64]:
    """Stamps [ns] of times [s], shape (n,), after a start [ns since the epoch]."""
    return start + np.round(np.asarray(seconds) * NS).astype(np.int64)


def counts(seconds: Array, speed: Array, per_count: float) -> NDArray[np.int64]:
    """Encoder counts that a measured speed implies: its trapezoidal integral in units of
    `per_count`, shape (n,).

    With `per_count` the quantum of the speed times the sampling interval, a count is the least
    travel the rig's log can tell, so that the integral claims no resolution the log does not have.
    """
    steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(seconds)
    return np.round(np.concatenate(([0.0], np.cumsum(steps))) / per_count).astype(np.int64)


def configuration(template: str, output: Path, name: str, **values: str) -> config.Configuration:
    """Fill a template of config/ and write it into the output folder; returns it as loaded. Raises
    RigFileError.
    """
    text = Template(packaged(template).read_text(encoding="utf-8")).substitute(values)

    path = output / name
    try:
        output.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        reason = error.strerror or error
        raise RigFileError(
            f"{path}: cannot be written: {reason}; expected a folder for the output", USAGE
        ) from None

    return config.load(path)


def write(
    path: Path,
    streams: Sequence[ChannelReadings],
    configured: config.Configuration,
    run: RunInfo,
    progress: Progress | None = None,
) -> Path:
    """One recording of raw topics, readings by stamp and then by the order of the channels.
    Replaces an earlier import. Progress counts the readings.

    Raises RecordingError.
    """
    with reported(path, "create"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.unlink(missing_ok=True)

    writer = RunWriter(path, (), configured.text, run)
    order = {channel: place for place, channel in enumerate(CHANNELS)}
    for block in _blocks(sorted(streams, key=lambda stream: order[stream.channel])):
        writer.readings([(stream.channel, stream.stamps, stream.values) for stream in block])
        if progress is not None:
            progress.advance(sum(stream.stamps.size for stream in block))
    writer.close()
    return path


def _blocks(streams: Sequence[ChannelReadings]) -> Iterator[list[ChannelReadings]]:
    """The readings of the streams, each by rising stamps, in times of STEP readings or fewer."""
    if not streams:
        return
    longest = max(streams, key=lambda stream: stream.stamps.size)
    edges = np.append(longest.stamps[STEP::STEP], np.iinfo(np.int64).max)
    begins = [0] * len(streams)
    for edge in edges.tolist():
        ends = [int(np.searchsorted(stream.stamps, edge)) for stream in streams]
        yield [
            ChannelReadings(stream.channel, stream.stamps[begin:end], stream.values[begin:end])
            for stream, begin, end in zip(streams, begins, ends, strict=True)
            if end > begin
        ]
        begins = ends
