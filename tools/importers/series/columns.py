"""Columns of a table of time series, whatever file they come from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gritd.tools.importers.files import Array, RigFileError


@dataclass(frozen=True)
class Column:
    """One column: numbers, shape (n,), NaN where the file has none; or words, shape (n,).

    resolution: the last digit that the file writes, in the column's unit; 0 where it is unknown.
    """

    numbers: Array
    words: Sequence[str] | None = None
    resolution: float = 0.0

    def at(self, chosen: NDArray[np.bool_]) -> Column:
        """The rows that are marked (n,)."""
        words = None
        if self.words is not None:
            words = [word for word, keep in zip(self.words, chosen, strict=True) if keep]
        return Column(self.numbers[chosen], words, self.resolution)


@dataclass(frozen=True)
class SeriesTable:
    """The columns of one file by name, all of n rows, in the file's order.

    first: number of the file's row that holds the first values, for messages.
    units: what a row of units, or the file's own description, says of a column; may lack some.
    """

    path: Path
    columns: Mapping[str, Column]
    first: int = 1
    units: Mapping[str, str] | None = None

    @property
    def rows(self) -> int:
        return len(next(iter(self.columns.values())).numbers)

    def column(self, name: str) -> Column:
        """A column by name. Raises RigFileError."""
        if name not in self.columns:
            raise RigFileError(
                f"{self.path}: found no column {name!r}; expected one of {self.names()}"
            )
        return self.columns[name]

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
        return ", ".join(self.columns)

    def at(self, chosen: NDArray[np.bool_]) -> SeriesTable:
        """The rows that are marked (n,)."""
        columns = {name: column.at(chosen) for name, column in self.columns.items()}
        return SeriesTable(self.path, columns, self.first, self.units)
