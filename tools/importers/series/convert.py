"""Rows to readings: every column becomes the raw values of a channel, and the calibration that
turns them into physics again.

A number of the file stands as one volt, one newton or one newton metre, so that the raw topic holds
what the file held. Angles, positions and speeds become counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.settings import Settings, Uncertain
from gritd.estimator.messages.readings import WRENCH_FIELDS
from gritd.tools.cli.command import USAGE
from gritd.tools.importers.files import Array, RigFileError
from gritd.tools.importers.recording import UNKNOWN, ChannelReadings, stamps
from gritd.tools.importers.series import encoders
from gritd.tools.importers.series.calibrated import CalibratedChannel
from gritd.tools.importers.series.mapping import AS_CONFIGURED, Mapped, SeriesMap
from gritd.tools.importers.series.noise import scatter
from gritd.tools.importers.series.runs import SeriesRun

ANALOGUE = {
    "sinkage_pot": ("sinkage", "sinkage_volts"),
    "motor_shunt": ("current", "motor_torque", "shunt_volts"),
    "motor_temperature": ("motor_temperature",),
}
TOGETHER = 0.5  # share of the rows of the slowest axis that axes of one clock have in common
NEAR = 3.0  # usual intervals between two readings that a third may lie between
AXES = {"drawbar_pull": "fx", "lateral_force": "fy", "load": "fz", "torque": "ty"}


@dataclass(frozen=True)
class Imported:
    """Every run as streams, with one calibration for all.

    configured: noise [raw] of the channels that keep the calibration of the configuration.
    axes: those of the wrench; none where no force was measured.
    intervals: time between two readings of each channel [s].
    """

    streams: tuple[tuple[ChannelReadings, ...], ...]
    channels: dict[str, CalibratedChannel]
    configured: dict[str, float]
    axes: dict[str, CalibratedChannel]
    intervals: dict[str, float]


def converted(
    runs: Sequence[SeriesRun], mapped: SeriesMap, settings: Settings, start: int
) -> Imported:
    """All runs as readings. `settings` gives radii, weights and torque constant; `start` [ns] is
    when the first begins where the files do not say. Raises RigFileError.
    """
    used = _used(mapped)
    noise = {name: _noise(runs, mapped, name) for name in used.values()}
    intervals = {channel: _interval(runs, [name]) for channel, name in used.items()}
    quanta = {
        channel: encoders.quantum(runs, name, mapped.columns[name])
        for channel, name in used.items()
        if channel in encoders.CHANNELS
    }
    every = {
        channel: _calibrated(
            mapped.columns[name], quanta.get(channel), noise[name], intervals[channel], settings
        )
        for channel, name in used.items()
    }
    channels = {
        channel: made
        for channel, made in every.items()
        if mapped.columns[used[channel]].channel not in AS_CONFIGURED
    }
    configured = {channel: made.noise for channel, made in every.items() if channel not in channels}

    streams = tuple(
        tuple(_streams(run, first, mapped, used, quanta, settings))
        for run, first in zip(runs, _starts(runs, start), strict=True)
    )
    measured = [name for name in map(mapped.named, AXES) if name is not None]
    intervals |= {"wrench": _interval(runs, measured)} if measured else {}
    return Imported(streams, channels, configured, _axes(runs, mapped, settings), intervals)


def _interval(runs: Sequence[SeriesRun], names: Sequence[str]) -> float:
    """Time between two readings [s] of columns that are read together."""
    return max(float(np.median([run.interval_of(name) for run in runs])) for name in names)


def _used(mapped: SeriesMap) -> dict[str, str]:
    """Channel of the recording -> column. Raises RigFileError without both encoders; a drive alone
    has no carriage.
    """
    used = {}
    for channel, choices in (encoders.CHANNELS | ANALOGUE).items():
        names = [name for name in map(mapped.named, choices) if name is not None]
        if len(names) > 1:
            raise RigFileError(
                f"columns: found {names[0]!r} and {names[1]!r} for {channel}; expected one", USAGE
            )
        if names:
            used[channel] = names[0]
        elif channel in encoders.CHANNELS and not mapped.drive_alone:
            raise RigFileError(
                f"columns: found none for the {channel}; expected one with channel: "
                f"{' or '.join(choices)}",
                USAGE,
            )

    return used


def _starts(runs: Sequence[SeriesRun], start: int) -> list[int]:
    """When each run begins [ns since the epoch]; a minute after the end of the last, where the
    files do not say.
    """
    starts = []
    for run in runs:
        starts.append(start if run.start is None else run.start)
        start += round((run.seconds[-1] + 60.0) * 1e9)
    return starts


# --- calibration ---


def _noise(runs: Sequence[SeriesRun], mapped: SeriesMap, name: str) -> float:
    """Standard deviation of one number of a column, in its unit: as stated, or the median of the
    runs' own. Raises RigFileError where it cannot be estimated.
    """
    column = mapped.columns[name]
    if not any(np.any(np.isfinite(run.table.column(name).numbers)) for run in runs):
        raise RigFileError(
            f"{runs[0].table.path}: {name}: found no number in it; expected some, or no line of "
            "this column in the map",
            USAGE,
        )
    if column.noise is not None:
        return column.noise / column.per_unit

    own = [run.table.column(name) for run in runs]
    each = [
        scatter(run.seconds, encoders.end_to_end(values.numbers, column), values.resolution)
        for run, values in zip(runs, own, strict=True)
    ]
    known = [sigma for sigma in each if sigma > 0.0]
    if not known:
        raise RigFileError(
            f"{runs[0].table.path}: {name}: never changes, so that its noise cannot be estimated; "
            "expected noise: in the map",
            USAGE,
        )
    return float(np.median(known))


def _calibrated(
    column: Mapped,
    quantum: float | None,
    noise: float,
    interval: float,
    settings: Settings,
) -> CalibratedChannel:
    """Of one channel: an encoder's counts, or a column's numbers as volts."""
    if quantum is not None:
        return encoders.calibrated(column, quantum, noise, interval, settings)

    torque = column.channel == "motor_torque"
    constant = settings.drive.torque_constant.value if torque else 1.0
    scale, factor, offset = column.per_unit / constant, column.factor, column.offset
    return CalibratedChannel(
        Uncertain(scale * factor.value, scale * factor.sigma),
        Uncertain(offset.value / constant, offset.sigma / constant),
        noise,
    )


def _axes(
    runs: Sequence[SeriesRun], mapped: SeriesMap, settings: Settings
) -> dict[str, CalibratedChannel]:
    """The wrench's axes, where any is measured. A load that is not is the weights of the run; any
    other that is not carries no information.
    """
    named = {axis: name for axis in AXES if (name := mapped.named(axis)) is not None}
    if not named:
        return {}

    weights = Uncertain(0.0, settings.load.nominal.sigma)
    absent = {axis: weights if axis == "load" else Uncertain(0.0, UNKNOWN) for axis in AXES}
    calibrations = {
        axis: CalibratedChannel(Uncertain(1.0), offset, 0.0) for axis, offset in absent.items()
    }
    for axis, name in named.items():
        column = mapped.columns[name]
        noise = _noise(runs, mapped, name) * column.per_unit
        calibrations[axis] = CalibratedChannel(column.factor, column.offset, noise)
    return calibrations


# --- streams ---


def _streams(
    run: SeriesRun,
    start: int,
    mapped: SeriesMap,
    used: dict[str, str],
    quanta: dict[str, float],
    settings: Settings,
) -> list[ChannelReadings]:
    """The readings of one run; where a cell is empty there is none."""
    at = stamps(start, run.seconds)
    streams = []
    for channel, name in used.items():
        column, numbers = mapped.columns[name], run.table.column(name).numbers
        known = np.isfinite(numbers)
        stamped, values = _chosen(at, known), _chosen(numbers, known)
        if channel in quanta:
            seconds = _chosen(run.seconds, known)
            values = encoders.counted(seconds, values, column, quanta[channel])
        streams.append(ChannelReadings(channel, stamped, values))

    if any(mapped.named(axis) for axis in AXES):
        weights = run.info.nominal_load or settings.load.nominal.value
        streams.append(_wrench(run, at, mapped, weights))
    return [stream for stream in streams if stream.stamps.size]


def _chosen(rows: NDArray[Any], known: NDArray[np.bool_]) -> NDArray[Any]:
    """The rows (n, …) that are marked; the same ones, not a copy, where all are."""
    return rows if np.all(known) else rows[known]


def _wrench(
    run: SeriesRun, at: NDArray[np.int64], mapped: SeriesMap, weights: float
) -> ChannelReadings:
    """Rows in which every measured axis has a number; N and N·m as the file's units say."""
    measured = {field: name for axis, field in AXES.items() if (name := mapped.named(axis))}
    columns = [run.table.column(name).numbers for name in measured.values()]
    columns = _of_one_clock(run.seconds, columns)

    six = np.zeros((at.size, len(WRENCH_FIELDS)), order="F")  # columns of zeros take no memory
    if "fz" not in measured:
        six[:, WRENCH_FIELDS.index("fz")] = weights
    known = np.ones(at.size, dtype=bool)
    for (field, name), numbers in zip(measured.items(), columns, strict=True):
        six[:, WRENCH_FIELDS.index(field)] = numbers * mapped.columns[name].per_unit
        known &= np.isfinite(numbers)

    return ChannelReadings("wrench", _chosen(at, known), _chosen(six, known))


def _of_one_clock(seconds: Array, columns: list[Array]) -> list[Array]:
    """Axes (n,) that several sensors read: each at the times of the slowest, on the line between
    its neighbours where these are close. Axes of one clock stay as they are.
    """
    counts = [int(np.isfinite(column).sum()) for column in columns]
    together = int(np.logical_and.reduce([np.isfinite(c) for c in columns]).sum())
    if together > TOGETHER * min(counts) or not min(counts):
        return columns

    slowest = np.isfinite(columns[int(np.argmin(counts))])
    return [_between(seconds, column, slowest) for column in columns]


def _between(seconds: Array, column: Array, wanted: NDArray[np.bool_]) -> Array:
    """Numbers (n,) at the rows that are wanted, NaN elsewhere and where a neighbour is far."""
    known = np.flatnonzero(np.isfinite(column))
    made = np.full(column.size, np.nan)
    rows = np.flatnonzero(wanted)
    after = np.searchsorted(known, rows)
    inside = (after < known.size) & (
        (after > 0) | (known[np.minimum(after, known.size - 1)] == rows)
    )
    rows, after = rows[inside], after[inside]

    right = known[after]
    left = np.where(right == rows, right, known[np.maximum(after - 1, 0)])
    close = seconds[right] - seconds[left] <= NEAR * float(np.median(np.diff(seconds[known])))
    made[rows[close]] = np.interp(seconds[rows[close]], seconds[known], column[known])
    return made
