"""The runs of the files: which rows, when they were taken, and what is known of each run."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from gritd.estimator.config.names import is_file_name
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.offline.windows import Ints, group_means
from gritd.tools.cli.command import USAGE
from gritd.tools.importers.files import Array, RigFileError
from gritd.tools.importers.series.columns import Column, SeriesTable
from gritd.tools.importers.series.mapping import CLOCK, SeriesMap
from gritd.tools.importers.series.noise import spacing

OF_DAY = re.compile(r"(\d{1,2}):(\d\d):(\d\d(?:\.\d+)?)")
DAY = 86400.0  # [s]
LEAST = 10  # rows of a run
EPOCH = 1e8  # [s] later times count from 1970


@dataclass(frozen=True)
class SeriesRun:
    """One run: its rows in the order of time.

    seconds: (n,) of the rows, rising; since 1970 where the file says so.
    resampled: rows behind each row of the table.
    repeated: rows of the file that were the row before once more, and are left out.
    """

    info: RunInfo
    table: SeriesTable
    seconds: Array
    resampled: float = 1.0
    repeated: int = 0

    @property
    def interval(self) -> float:
        """Time between two rows [s], the median."""
        return float(np.median(np.diff(self.seconds)))


def runs_of(tables: Sequence[SeriesTable], mapped: SeriesMap) -> list[SeriesRun]:
    """All runs of the files. Raises RigFileError."""
    runs = [run for table in tables for run in _of_table(table, mapped)]
    names = [run.info.name for run in runs]

    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise RigFileError(f"found two runs {twice!r}; expected each with a name of its own")
    unknown = next((name for name in mapped.runs if _stem(name) not in names), None)
    if unknown is not None:
        raise RigFileError(
            f"runs: found {unknown!r}, which is no run; expected one of {', '.join(names)}", USAGE
        )
    return runs


def _of_table(table: SeriesTable, mapped: SeriesMap) -> Iterator[SeriesRun]:
    """One run a file, or one for each value of the column of runs."""
    for name in mapped.columns:
        table.column(name)
    seconds = _seconds(table, mapped)

    column = mapped.named("run")
    if column is None:
        yield _run(table, seconds, _stem(table.path.name), mapped)
        return

    labels = np.array(_labels(table.column(column)))
    for label in dict.fromkeys(labels.tolist()):
        chosen = labels == label
        yield _run(table.at(chosen), seconds[chosen], label, mapped)


def _stem(name: str) -> str:
    """A file's name without what says its kind."""
    return re.sub(r"\.(csv|txt|tsv|dat|parquet|mat)(\.gz)?$", "", name, flags=re.IGNORECASE)


def _labels(column: Column) -> list[str]:
    if column.words is not None:
        return list(column.words)
    return [f"{value:g}" for value in column.numbers.tolist()]


def _run(table: SeriesTable, seconds: Array, name: str, mapped: SeriesMap) -> SeriesRun:
    """A run with what the map says of it. Raises RigFileError."""
    if not is_file_name(name):
        raise RigFileError(f"{table.path}: found the run {name[:40]!r}; expected a file's name")
    if seconds.size < LEAST:
        raise RigFileError(
            f"{table.path}: {name}: found {seconds.size} rows; expected {LEAST} or more"
        )

    again = table.repeated()
    table, seconds = table.at(~again), seconds[~again]
    if np.any(np.diff(seconds) <= 0.0):
        at = int(np.argmax(np.diff(seconds) <= 0.0))
        raise RigFileError(f"{table.path}: {name}: {_fallen(seconds[at], seconds[at + 1])}")

    run = SeriesRun(_info(table, name, mapped), table, seconds, repeated=int(again.sum()))
    return run if mapped.resample is None else _resampled(run, mapped.resample)


def _fallen(before: float, after: float) -> str:
    """What is wrong with a time [s] that does not lie behind the one before it."""
    if after == before:
        return f"found two rows of {before:.15g} s with different values; expected one row a time"
    return f"found {after:.15g} s after {before:.15g} s; expected times that rise"


def _info(table: SeriesTable, name: str, mapped: SeriesMap) -> RunInfo:
    """What the columns say of the run, then the map."""
    told = {_stem(key): info for key, info in mapped.runs.items()}.get(name, RunInfo())
    load = told.nominal_load or _constant(table, mapped, "nominal_load") or mapped.load
    start, number = (_constant(table, mapped, key) for key in ("start", "pass"))

    return replace(
        told,
        name=name,
        nominal_load=load,
        start_position=told.start_position if start is None else start,
        pass_number=told.pass_number if number is None else round(number),
        operator=told.operator or mapped.operator,
        notes=told.notes or mapped.notes,
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
        told = f"{known.min():g} to {known.max():g}" if known.size else "no number"
        raise RigFileError(
            f"{table.path}: {name}: found {told}; expected one {channel} for the whole run"
        )
    return float(known[0]) * mapped.columns[name].per_unit


# --- time ---


def _seconds(table: SeriesTable, mapped: SeriesMap) -> Array:
    """Time of each row [s], (n,). Raises RigFileError."""
    name = mapped.named("time")
    if name is None:
        assert mapped.rate is not None
        return np.arange(table.rows) / mapped.rate

    column, unit = table.column(name), mapped.columns[name].unit
    if column.words is not None:
        if unit != CLOCK:
            raise RigFileError(
                f"{table.path}: {name}: found {column.words[0][:40]!r}; expected numbers in "
                f"{unit}, or unit: {CLOCK} for dates and times of day"
            )
        return _clock(table, name, column.words)

    if not np.all(np.isfinite(column.numbers)):
        row = table.first + int(np.argmin(np.isfinite(column.numbers)))
        raise RigFileError(f"{table.path}: row {row}: {name}: found no time; expected one a row")
    return column.numbers * (1.0 if unit == CLOCK else mapped.columns[name].per_unit)


def _clock(table: SeriesTable, name: str, words: Sequence[str]) -> Array:
    """Seconds of dates, as UTC where they name no zone, or of times of day."""
    instants = np.empty(len(words))

    for at, word in enumerate(words):
        try:
            instants[at] = _instant(word.strip())
        except ValueError:
            raise RigFileError(
                f"{table.path}: row {table.first + at}: {name}: found {word[:40]!r}; "
                "expected a date such as 2026-11-22T14:03:05.250 or a time such as 14:03:05.250"
            ) from None

    past_midnight = np.concatenate(([0.0], np.cumsum(np.diff(instants) < -0.5 * DAY)))
    return instants + DAY * past_midnight


def _instant(word: str) -> float:
    if match := OF_DAY.fullmatch(word):
        return int(match[1]) * 3600.0 + int(match[2]) * 60.0 + float(match[3])
    when = datetime.fromisoformat(word)
    return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()


# --- resampling ---


def _resampled(run: SeriesRun, rate: float) -> SeriesRun:
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
    columns = {
        name: _mean(column, block, seconds.size) for name, column in run.table.columns.items()
    }
    behind = run.seconds.size / seconds.size
    table = SeriesTable(run.table.path, columns, run.table.first, run.table.units)
    return SeriesRun(run.info, table, seconds, behind, run.repeated)


def _mean(column: Column, block: Ints, n: int) -> Column:
    """Means of the numbers in each of n blocks; NaN where there is none."""
    known = np.isfinite(column.numbers)
    means, count = group_means(block[known], column.numbers[known], n)
    digits = column.resolution or spacing(column.numbers)
    return Column(means, None, digits / max(count.max(), 1))
