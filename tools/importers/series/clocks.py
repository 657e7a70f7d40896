"""Runs from files of several clocks: a table a sensor, a topic a sensor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from gritd.tools.cli.command import USAGE
from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.series.columns import Advance, Column, SeriesTable
from gritd.tools.importers.series.mapping import MEASURED, SeriesMap
from gritd.tools.importers.series.runs import EPOCH, SeriesRun, info_of, of_table, resampled
from gritd.tools.importers.series.sources import RunFiles, SourcePart, parts
from gritd.tools.importers.series.times import NS, Nanoseconds

SLOW = "motor_temperature"  # a channel that may be slow: the filter does not wait for it


def runs_of(files: RunFiles, mapped: SeriesMap, advances: Sequence[Advance]) -> Iterator[SeriesRun]:
    """The runs of a file, or of the files that belong together; `advances` for each. Raises
    RigFileError.
    """
    found = [
        part
        for (source, path), tell in zip(files.files, advances, strict=True)
        for part in parts(path, source, mapped, tell)
    ]
    yield from runs_of_parts(found, mapped, files.name)


def runs_of_parts(found: Sequence[SourcePart], mapped: SeriesMap, name: str) -> Iterator[SeriesRun]:
    """The same of files that were read. Raises RigFileError."""
    if len(found) == 1:
        yield from of_table(found[0].table, found[0].mapped, name)
        return

    each = [list(of_table(part.table, replace(part.mapped, resample=None), name)) for part in found]
    for own in _aligned(each, found, name):
        run = _together(own, found, mapped)
        run = replace(run, info=replace(info_of(run.table, name, mapped), name=own[0].info.name))
        yield run if mapped.resample is None else resampled(run, mapped.resample)


def _aligned(
    each: Sequence[Sequence[SeriesRun]], found: Sequence[SourcePart], name: str
) -> Iterator[tuple[SeriesRun, ...]]:
    """The runs of all clocks that are one. Raises RigFileError."""
    for runs, part in zip(each, found, strict=True):
        if len(runs) != len(each[0]):
            raise RigFileError(
                f"{name}: found {len(each[0])} runs in {_named(found[0])}, but {len(runs)} in "
                f"{_named(part)}; expected as many in each"
            )
    yield from zip(*each, strict=True)


def _named(part: SourcePart) -> str:
    return f"{part.table.path.name} ({list(part.table.columns)[-1]})"


def _together(
    runs: Sequence[SeriesRun], found: Sequence[SourcePart], mapped: SeriesMap
) -> SeriesRun:
    """One run with the rows of all: a row of one clock has no numbers in the columns of others.
    Raises RigFileError.
    """
    times = [
        run.began + round(part.shift * NS) + np.round(run.seconds * NS).astype(np.int64)
        for run, part in zip(runs, found, strict=True)
    ]
    _check_overlap(times, found)

    instants = np.unique(np.concatenate(times))
    columns, intervals = {}, {}
    for run, own, part in zip(runs, times, found, strict=True):
        rows = np.searchsorted(instants, own)
        for label, kind in part.mapped.columns.items():
            if label in mapped.columns and kind.channel not in ("time", "date"):
                columns[label] = _at(run.table.columns[label], rows, instants.size)
            if kind.channel in MEASURED and kind.channel != SLOW:
                intervals[label] = run.interval

    begins = int(instants[0])
    notes = dict.fromkeys(note for run in runs for note in (*run.table.notes, *run.notes))
    return SeriesRun(
        runs[0].info,
        SeriesTable(runs[0].table.path, columns),
        (instants - begins) / NS,
        begins if begins > EPOCH else None,
        repeated=sum(run.repeated for run in runs),
        notes=tuple(notes),
        began=begins,
        intervals=intervals,
    )


def _at(column: Column, rows: Nanoseconds, size: int) -> Column:
    """A column of another clock: at its rows, NaN elsewhere, shape (size,)."""
    numbers = np.full(size, np.nan)
    numbers[rows] = column.numbers
    return Column(numbers, None, column.resolution)


def _check_overlap(times: Sequence[Nanoseconds], found: Sequence[SourcePart]) -> None:
    """Raises RigFileError where clocks have no time in common."""
    last = max(range(len(times)), key=lambda at: int(times[at][0]))
    first = min(range(len(times)), key=lambda at: int(times[at][-1]))
    apart = (int(times[last][0]) - int(times[first][-1])) / NS
    if apart > 0.0:
        raise RigFileError(
            f"{_named(found[last])} begins {apart:.6g} s after {_named(found[first])} ends; "
            "expected clocks that run together; shift: in the map is added to the times of a file",
            USAGE,
        )
