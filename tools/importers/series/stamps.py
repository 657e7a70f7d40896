"""When each row of a table was taken, and which rows follow each other in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config import units
from gritd.tools.importers.files import Array, RigFileError
from gritd.tools.importers.series.columns import Column, SeriesTable, row_numbers
from gritd.tools.importers.series.mapping import CLOCK, Mapped, SeriesMap
from gritd.tools.importers.series.times import (
    NONE,
    NS,
    Nanoseconds,
    TimeFormat,
    TimeFormatError,
    clock,
    of_floats,
    of_numbers,
    of_texts,
    per_unit,
    unwrapped,
)

LEAST = 10  # rows of a run
GLITCH = 1 * NS  # a time that falls by less was set back; by more it began again
AHEAD = 10  # usual intervals: a time that leaps by more, and back, is one odd stamp
BITS = (16, 24, 32)  # of a counter
REPEATED = 0.2  # share of rows with the time of the row before: the clock is too coarse


class TimeColumn:
    """A column of time as its map states it, read block by block."""

    def __init__(self, mapped: Mapped) -> None:
        self._mapped = mapped
        self._clock: TimeFormat | None = None

    def read(self, words: Sequence[str]) -> Nanoseconds:
        """[ns], shape (n,), NONE where a word is a gap. Raises TimeFormatError."""
        if self._mapped.unit != CLOCK:
            return self._counted(of_texts(words, self._unit))
        if self._clock is None:
            self._clock = clock(words, self._mapped.order)
        return self._clock.read(words)

    def plain(self, values: Array) -> Nanoseconds | None:
        """[ns] of numbers (n,), as of their words; None where these may say more."""
        instants = of_floats(values, self._unit)
        return None if instants is None else self._counted(instants)

    def column(self, column: Column) -> Column:
        """A column that was read already, with its instants. Raises TimeFormatError."""
        if column.instants is not None:
            return column
        if column.words is not None:
            return replace(column, instants=self.read(column.words), period=self.period)
        if self._mapped.unit == CLOCK:
            raise TimeFormatError("found numbers; expected dates, or the unit of the numbers")
        return replace(column, instants=self._counted(of_numbers(column.numbers, self._unit)))

    @property
    def period(self) -> int:
        """After how many ns the times begin again; 0 where they do not."""
        return self._clock.period if self._clock else 0

    @property
    def _unit(self) -> int:
        return per_unit(units.unit(self._mapped.unit).factor)

    def _counted(self, instants: Nanoseconds) -> Nanoseconds:
        """From 1970 on, where the map states the day that a number counts from."""
        return np.where(instants == NONE, NONE, instants + self._mapped.epoch)


def instants(table: SeriesTable, mapped: SeriesMap) -> Nanoseconds:
    """When each row was taken [ns], shape (n,), NONE where the file does not tell. Raises
    RigFileError.
    """
    timed = [
        _read(table, name, mapped.columns[name])
        for name in (mapped.named("date"), mapped.named("time"))
        if name is not None
    ]
    times = [column.instants for column in timed if column.instants is not None]
    if mapped.rate is not None:
        begin = sum(int(each[each != NONE][:1].sum()) for each in times)
        return begin + np.round(_places(table) * (NS / mapped.rate)).astype(np.int64)

    known = np.all([each != NONE for each in times], axis=0)
    total = np.where(known, sum(times), NONE)
    one_day = len(times) == 1 or np.all(np.diff(times[0][known]) == 0)
    if one_day and (period := timed[-1].period or _counter(total[known], mapped)):
        total[known] = unwrapped(total[known], period)
    return total


def _places(table: SeriesTable) -> NDArray[np.int64]:
    """Which row each is (n,), counted from 0 with those that were left out."""
    rows = np.arange(table.rows)
    if table.left_out is None or table.lines is None:
        return rows
    return np.asarray(rows + np.searchsorted(table.left_out, table.lines))


def _counter(times: Nanoseconds, mapped: SeriesMap) -> int:
    """After how many ns the times (n,) of a counter begin again: the range of its bits, where they
    go on behind every fall as if they had it. 0 of others.
    """
    name = mapped.named("time")
    steps = np.diff(times)
    falls = np.flatnonzero(steps < 0)
    if name is None or not falls.size or mapped.columns[name].unit == CLOCK:
        return 0

    unit = per_unit(units.unit(mapped.columns[name].unit).factor)
    usual = AHEAD * np.median(np.abs(steps))
    sizes = [unit << bits for bits in BITS if unit << bits < 2**62 and times.max() < unit << bits]
    return next((s for s in sizes if np.all(np.abs(steps[falls] + s) <= usual)), 0)


def _read(table: SeriesTable, name: str, mapped: Mapped) -> Column:
    try:
        return TimeColumn(mapped).column(table.column(name))
    except TimeFormatError as error:
        raise RigFileError(f"{table.path}: row {table.line(error.at)}: {name}: {error}") from None


# --- order ---


@dataclass(frozen=True)
class Order:
    """Which rows (n,) are kept, and where a further run begins, as time began again."""

    kept: NDArray[np.bool_]
    begins: tuple[int, ...]


def ordered(times: Nanoseconds) -> Order:
    """The order of times (n,). Left out is a row that does not lie behind the one before it. Where
    the time falls and stays behind, a new run begins.
    """
    kept, begins, done = np.ones(times.size, dtype=bool), [0], 0
    step = float(np.median(np.abs(np.diff(times)))) if times.size > 1 else 0.0

    for before in np.flatnonzero(np.diff(times) <= 0).tolist():
        row = before + 1
        if row < done:
            continue
        if times[row] == times[before]:
            kept[row] = False
        elif _leapt(times, before, begins[-1], step):
            kept[before] = False
        elif (end := _caught_up(times, row, step)) is not None:
            kept[row:end] = False
            done = end
        else:
            begins.append(row)

    return Order(kept, tuple(begins))


def _leapt(times: Nanoseconds, at: int, begin: int, step: float) -> bool:
    """Whether one row's time lies far ahead of both its neighbours, which rise."""
    if at <= begin or times[at + 1] <= times[at - 1]:
        return False
    return bool(times[at] - times[at - 1] > AHEAD * step)


def _caught_up(times: Nanoseconds, row: int, step: float) -> int | None:
    """The first row, soon after a fall, whose time lies behind that before the fall again."""
    fall = int(times[row - 1] - times[row])
    rows = LEAST if fall > GLITCH else LEAST + int(2 * fall / max(step, 1.0))
    behind = times[row : row + rows] > times[row - 1]
    return row + int(np.argmax(behind)) if np.any(behind) else None


def check_fine(table: SeriesTable, times: Nanoseconds) -> None:
    """Raises RigFileError where a clock is coarser than the rows, so that many have one time."""
    same = np.diff(times) == 0
    if same.sum() > REPEATED * times.size:
        row = table.line(int(np.argmax(same)) + 1)
        raise RigFileError(
            f"{table.path}: found {int(same.sum())} of {times.size} rows with the time of the row "
            f"before but other values, the first row {row}; "
            "expected one row a time, or rate: in the map"
        )


def left_out(table: SeriesTable, gone: NDArray[np.bool_], why: str) -> list[str]:
    """A line on rows (n,) that are left out; none where there are none."""
    if not np.any(gone):
        return []
    rows = [table.line(at) for at in np.flatnonzero(gone).tolist()]
    return [f"{table.path.name}: left out {row_numbers(rows)}: {why}"]
