"""Columns of a table of time series, whatever file they come from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.nearest import did_you_mean, listed
from gritd.tools.importers.files import Array, RigFileError
from gritd.tools.importers.series.times import Nanoseconds

SHOWN = 40  # characters of a name in a message
Advance = Callable[[int], None]  # takes the bytes of a file that were read
COMPARED = 2000  # names with which a mistyped one is compared
FEW = 5  # rows that are reported one by one


@dataclass(frozen=True)
class Column:
    """One column: numbers, shape (n,), NaN where the file has none; or words, shape (n,).

    resolution: the last digit that the file writes, in the column's unit; 0 where it is unknown.
    instants: of a column of time, [ns], shape (n,), NONE where there is none; else None.
    period: after how many ns the instants begin again, as times of day do; 0 where they do not.
    """

    numbers: Array
    words: Sequence[str] | None = None
    resolution: float = 0.0
    instants: Nanoseconds | None = None
    period: int = 0

    def at(self, chosen: NDArray[np.bool_]) -> Column:
        """The rows that are marked (n,)."""
        words = None
        if self.words is not None:
            words = [word for word, keep in zip(self.words, chosen, strict=True) if keep]
        instants = None if self.instants is None else self.instants[chosen]
        return Column(self.numbers[chosen], words, self.resolution, instants, self.period)


@dataclass(frozen=True)
class SeriesTable:
    """The columns of one file by name, all of n rows, in the file's order.

    units: what a row of units, or the file's own description, says of a column; may lack some.
    lines: number of each row in the file (n,), for messages; None where they count from 1.
    left_out: numbers of the rows that were not read, rising; None where none were.
    notes: what was not read, or what the user should know otherwise, one line each.
    group: what stands with a dot before the name of every column; a file may hold several tables.
    clock: when the rows were taken [ns], shape (n,), NONE where that is not known; None where the
        file itself does not tell.
    """

    path: Path
    columns: Mapping[str, Column]
    units: Mapping[str, str] | None = None
    lines: NDArray[np.int64] | None = None
    notes: tuple[str, ...] = ()
    group: str = ""
    clock: Nanoseconds | None = None
    left_out: NDArray[np.int64] | None = None

    @property
    def rows(self) -> int:
        return len(next(iter(self.columns.values())).numbers)

    def short(self, name: str) -> str:
        """A column's name without that of its group."""
        return name.removeprefix(f"{self.group}.") if self.group else name

    def column(self, name: str) -> Column:
        """A column by name. Raises RigFileError."""
        if name not in self.columns:
            raise RigFileError(
                f"{self.path}: found no column {name[:SHOWN]!r}; expected one of {self.names()}"
            )
        return self.columns[name]

    def line(self, at: int) -> int:
        """The number that a row has in its file."""
        return at + 1 if self.lines is None else int(self.lines[at])

    def repeated(self) -> NDArray[np.bool_]:
        """Marks rows (n,) that are the row before once more, in every column."""
        again = np.ones(self.rows, dtype=bool)
        again[:1] = False

        for column in self.columns.values():
            if column.words is not None:
                words = np.array(column.words, dtype=object)
                again[1:] &= words[1:] == words[:-1]
            else:
                now, before = column.numbers[1:], column.numbers[:-1]
                again[1:] &= (now == before) | (np.isnan(now) & np.isnan(before))

        return again

    def names(self) -> str:
        """Of all columns, as many as a line has room for."""
        return listed(list(self.columns))

    def at(self, chosen: NDArray[np.bool_]) -> SeriesTable:
        """The rows that are marked (n,)."""
        if np.all(chosen):
            return self
        columns = {name: column.at(chosen) for name, column in self.columns.items()}
        lines = None if self.lines is None else self.lines[chosen]
        clock = None if self.clock is None else self.clock[chosen]
        return replace(self, columns=columns, lines=lines, clock=clock)


@dataclass(frozen=True)
class Wanted:
    """Which columns are to be read, by their names with or without that of the group.

    names: None for all. rows: so many of each group are enough; None for all.
    """

    names: frozenset[str] | None = None
    rows: int | None = None

    def has(self, name: str, group: str = "") -> bool:
        """Whether a column is wanted; `name` begins with the group's."""
        if self.names is None:
            return True
        short = name.removeprefix(f"{group}.") if group else name
        return name in self.names or short in self.names

    def touches(self, whole: str) -> bool:
        """Whether a thing is wanted, or a part of it: `x` where `x[0]` or `x.y` is."""
        if self.names is None or whole in self.names:
            return True
        return any(name.startswith((f"{whole}.", f"{whole}[")) for name in self.names)


EVERYTHING = Wanted()


def no_column(path: Path, name: str, known: Sequence[str]) -> RigFileError:
    """That a file has no column of a name, with those that it has."""
    meant = did_you_mean(name, known[:COMPARED])
    return RigFileError(
        f"{path}: found no column {name[:SHOWN]!r}{meant}; expected one of {listed(known)}"
    )


def row_numbers(numbers: Sequence[int]) -> str:
    """Numbers of rows in words, the first few."""
    few = ", ".join(map(str, numbers[:FEW]))
    if len(numbers) > FEW and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"rows {numbers[0]} to {numbers[-1]}"
    more = f" … {numbers[-1]} ({len(numbers)} in all)" if len(numbers) > FEW else ""
    return f"row{'s' if len(numbers) > 1 else ''} {few}{more}"
