"""The runs of the files: which rows, when they were taken, and what is known of each run."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.names import is_file_name
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.offline.windows import Ints, group_means
from gritd.tools.cli.command import USAGE
from gritd.tools.importers.files import Array, RigFileError
from gritd.tools.importers.series.columns import Column, SeriesTable, row_numbers
from gritd.tools.importers.series.mapping import SeriesMap
from gritd.tools.importers.series.noise import spacing
from gritd.tools.importers.series.sources import CLOCKS, stem
from gritd.tools.importers.series.stamps import (
    LEAST,
    Order,
    check_fine,
    instants,
    left_out,
    ordered,
)
from gritd.tools.importers.series.times import NONE, NS, Nanoseconds

EPOCH = 10**8 * NS  # later times count from 1970
MOST = 50  # runs of one file whose time begins again
Rows = NDArray[np.bool_]


@dataclass(frozen=True)
class SeriesRun:
    """One run: its rows in the order of time.

    seconds: (n,) of the rows since the first, rising.
    start: of the first row [ns since 1970]; None where the file does not say.
    began: of the first row [ns] by the clock of the file.
    resampled: rows behind each row of the table.
    repeated: rows of the file that were the row before once more, and are left out.
    notes: what else is left out, one line each.
    intervals: time between two rows [s] of each column, where they differ.
    """

    info: RunInfo
    table: SeriesTable
    seconds: Array
    start: int | None = None
    resampled: float = 1.0
    repeated: int = 0
    notes: tuple[str, ...] = ()
    began: int = 0
    intervals: Mapping[str, float] = field(default_factory=dict)

    @property
    def interval(self) -> float:
        """Time between two rows [s], the median; the longest of those that differ."""
        return max(self.intervals.values(), default=float(np.median(np.diff(self.seconds))))

    def interval_of(self, name: str) -> float:
        """Time between two rows [s] of a column, the median."""
        return self.intervals.get(name, self.interval)


def check(runs: Sequence[SeriesRun], mapped: SeriesMap) -> None:
    """Raises RigFileError where two runs have one name, or the map names one that is none."""
    names = [run.info.name for run in runs]

    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise RigFileError(f"found two runs {twice!r}; expected each with a name of its own")
    known = {re.sub(r"-\d+$", "", name) for name in names} | set(names)
    unknown = next((name for name in mapped.runs if stem(name) not in known), None)
    if unknown is not None:
        raise RigFileError(
            f"runs: found {unknown!r}, which is no run; expected one of {', '.join(names)}", USAGE
        )


def of_table(table: SeriesTable, mapped: SeriesMap, named: str) -> Iterator[SeriesRun]:
    """One run a file, or one for each value of the column of runs."""
    for name in mapped.columns:
        table.column(name)
    times = instants(table, mapped)

    column = mapped.named("run")
    if column is None:
        yield from _parts(table, times, named, mapped)
        return

    labels = np.array(_labels(table.column(column)))
    for label in dict.fromkeys(labels.tolist()):
        chosen = labels == label
        yield from _parts(table.at(chosen), times[chosen], label, mapped)


def _labels(column: Column) -> list[str]:
    if column.words is not None:
        return list(column.words)
    return [f"{value:g}" for value in column.numbers.tolist()]


def _parts(
    table: SeriesTable, times: Nanoseconds, name: str, mapped: SeriesMap
) -> Iterator[SeriesRun]:
    """A run with what the map says of it; several, NAME-1, NAME-2 …, where its time began again.
    Raises RigFileError.
    """
    if not is_file_name(name):
        raise RigFileError(f"{table.path}: found the run {name[:40]!r}; expected a file's name")

    timeless = times == NONE
    notes = left_out(table, timeless, "without a time")
    table, times = table.at(~timeless), times[~timeless]

    again = np.zeros(times.size, dtype=bool)
    if mapped.rate is None:
        again[1:] = table.repeated()[1:] & (np.diff(times) == 0)
    table, times = table.at(~again), times[~again]
    check_fine(table, times)

    order = ordered(times)
    notes += left_out(table, ~order.kept, "the time does not rise")
    parts = _long(table, order, name, notes)
    for number, rows in enumerate(parts, start=1):
        run = _run(table.at(rows), times[rows], name, mapped)
        if len(parts) > 1:
            run = replace(run, info=replace(run.info, name=f"{name}-{number}"))
        if number == 1:
            run = replace(run, repeated=int(again.sum()), notes=tuple(notes))
        yield run if mapped.resample is None else resampled(run, mapped.resample)


def _run(table: SeriesTable, times: Nanoseconds, name: str, mapped: SeriesMap) -> SeriesRun:
    began, info = int(times[0]), info_of(table, name, mapped)
    clocks = [mapped.named(channel) for channel in CLOCKS]
    kept = {name: column for name, column in table.columns.items() if name not in clocks}
    return SeriesRun(
        info,
        replace(table, columns=kept, lines=None),
        (times - began) / NS,
        began if began > EPOCH else None,
        began=began,
    )


def _long(table: SeriesTable, order: Order, name: str, notes: list[str]) -> list[Rows]:
    """The rows (n,) of each part that is long enough for a run, with notes on the others. Raises
    RigFileError where none is.
    """
    if len(order.begins) > MOST:
        raise RigFileError(
            f"{table.path}: {name}: found {len(order.begins) - 1} times that fall, the first at "
            f"row {table.line(order.begins[1])}; expected times that rise, or rate: in the map"
        )
    part = np.searchsorted(order.begins, np.arange(table.rows), side="right")
    marks = [order.kept & (part == number) for number in range(1, len(order.begins) + 1)]
    long = [rows for rows in marks if rows.sum() >= LEAST]
    if not long:
        most = max((int(rows.sum()) for rows in marks), default=0)
        raise RigFileError(f"{table.path}: {name}: found {most} rows; expected {LEAST} or more")

    for rows in marks:
        if rows.sum() < LEAST:
            notes += left_out(table, rows, f"fewer than {LEAST} between times that fall")
    if len(long) > 1:
        first = [table.line(int(np.argmax(rows))) for rows in long[1:]]
        notes.append(
            f"{table.path.name}: the time begins again at {row_numbers(first)}, a new run each; "
            "state rate: in the map where it is one run"
        )
    return long


def info_of(table: SeriesTable, name: str, mapped: SeriesMap) -> RunInfo:
    """What the columns say of the run, then the map."""
    stated = {stem(key): info for key, info in mapped.runs.items()}.get(name, RunInfo())
    load = stated.nominal_load or _constant(table, mapped, "nominal_load") or mapped.load
    start, number = (_constant(table, mapped, key) for key in ("start", "pass"))

    return replace(
        stated,
        name=name,
        nominal_load=load,
        start_position=stated.start_position if start is None else start,
        pass_number=stated.pass_number if number is None else round(number),
        operator=stated.operator or mapped.operator,
        notes=stated.notes or mapped.notes,
    )


def _constant(table: SeriesTable, mapped: SeriesMap, channel: str) -> float | None:
    """SI value of a column that does not change within a run; None without one. Raises
    RigFileError.
    """
    name = mapped.named(channel)
    if name is None:
        return None

    values = table.column(name).numbers
    known = values[np.isfinite(values)]
    if not known.size or np.ptp(known) > 0.0:
        shown = f"{known.min():g} to {known.max():g}" if known.size else "no number"
        raise RigFileError(
            f"{table.path}: {name}: found {shown}; expected one {channel} for the whole run"
        )
    return float(known[0]) * mapped.columns[name].per_unit


# --- resampling ---


def resampled(run: SeriesRun, rate: float) -> SeriesRun:
    """Means of the rows in intervals of 1/rate; where there are no rows there is no mean."""
    if rate * run.interval > 1.0:
        raise RigFileError(
            f"{run.table.path}: resample: found {rate:g} Hz; expected less than the "
            f"{1.0 / run.interval:g} Hz of the rows",
            USAGE,
        )
    slot = np.floor((run.seconds - run.seconds[0]) * rate).astype(np.int64)
    _, block = np.unique(slot, return_inverse=True)

    seconds, _ = group_means(block, run.seconds, block.max() + 1)
    start = None if run.start is None else run.start + round(float(seconds[0]) * NS)
    columns = {
        name: _mean(column, block, seconds.size) for name, column in run.table.columns.items()
    }
    table = SeriesTable(run.table.path, columns, run.table.units)
    behind = run.seconds.size / seconds.size
    return replace(run, table=table, seconds=seconds - seconds[0], start=start, resampled=behind)


def _mean(column: Column, block: Ints, n: int) -> Column:
    """Means of the numbers in each of n blocks; NaN where there is none."""
    known = np.isfinite(column.numbers)
    means, count = group_means(block[known], column.numbers[known], n)
    digits = column.resolution or spacing(column.numbers)
    return Column(means, None, digits / max(count.max(), 1))
