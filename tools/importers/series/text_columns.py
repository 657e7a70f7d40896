"""What the cells of a text table become, block by block: numbers, instants or words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gritd.tools.importers.files import Array
from gritd.tools.importers.series.cells import last_digit, loose, numbers
from gritd.tools.importers.series.columns import Column
from gritd.tools.importers.series.mapping import CLOCK, Mapped
from gritd.tools.importers.series.stamps import TimeColumn
from gritd.tools.importers.series.times import NONE, NS, Nanoseconds


class Growing:
    """An array (n,) that grows at its end. Of its spare room nothing is written, so it takes no
    memory.
    """

    def __init__(self, dtype: DTypeLike) -> None:
        self._room, self._size = np.empty(1024, dtype), 0

    def add(self, piece: NDArray[Any]) -> None:
        end = self._size + piece.size
        if end > self._room.size:
            room = np.empty(2 * end, self._room.dtype)
            room[: self._size] = self.whole
            self._room = room
        self._room[self._size : end] = piece
        self._size = end

    @property
    def whole(self) -> NDArray[Any]:
        return self._room[: self._size]


class Builder(Protocol):
    """One column in the making. `convert` raises OddCell or TimeFormatError, and keeps nothing.

    numeric: whether `plain` may make of numbers (n,) what `convert` makes of their words; None
    where a number does not hold all that its word says.
    """

    numeric: bool

    def convert(self, cells: Sequence[str]) -> Any: ...
    def plain(self, values: Array) -> Any: ...
    def keep(self, piece: Any) -> None: ...
    def column(self) -> Column: ...


class NumberColumn:
    """A column of numbers; `first` are some of its cells, which tell its last digit. `commas`:
    whether a comma in it can only be a decimal one.
    """

    numeric = True

    def __init__(self, first: Sequence[str], commas: bool) -> None:
        self._commas = commas
        self._kept = Growing(np.float64)
        self._resolution = last_digit(first)

    def convert(self, cells: Sequence[str]) -> Array:
        return numbers(cells, self._commas)

    def plain(self, values: Array) -> Array:
        values[~np.isfinite(values)] = math.nan
        return values

    def keep(self, piece: Array) -> None:
        self._kept.add(piece)

    def column(self) -> Column:
        return Column(self._kept.whole, resolution=self._resolution)


class Times:
    """A column of time or of dates."""

    def __init__(self, mapped: Mapped) -> None:
        self._time = TimeColumn(mapped)
        self._kept = Growing(np.int64)
        self.numeric = mapped.unit != CLOCK

    def convert(self, cells: Sequence[str]) -> Nanoseconds:
        return self._time.read(cells)

    def plain(self, values: Array) -> Nanoseconds | None:
        return self._time.plain(values)

    def keep(self, piece: Nanoseconds) -> None:
        self._kept.add(piece)

    def column(self) -> Column:
        instants = self._kept.whole
        seconds = np.where(instants == NONE, math.nan, instants / NS)
        return Column(seconds, instants=instants, period=self._time.period)


class _Worded:
    """A column that numbers cannot tell."""

    numeric = False

    def plain(self, values: Array) -> None:
        return None


class Words(_Worded):
    """A column of words; equal ones are kept once."""

    def __init__(self) -> None:
        self._known: dict[str, str] = {}
        self._words: list[str] = []

    def convert(self, cells: Sequence[str]) -> list[str]:
        return [self._known.setdefault(word, word) for word in map(str.strip, cells)]

    def keep(self, piece: list[str]) -> None:
        self._words += piece

    def column(self) -> Column:
        return Column(np.full(len(self._words), math.nan), self._words)


class Loose(_Worded):
    """A column of which nothing is known: numbers; with the words, where one cell is none."""

    def __init__(self, first: Sequence[str]) -> None:
        self._cells: list[str] = []
        self._resolution = last_digit(first)

    def convert(self, cells: Sequence[str]) -> list[str]:
        return [cell.strip() for cell in cells]

    def keep(self, piece: list[str]) -> None:
        self._cells += piece

    def column(self) -> Column:
        values, odd = loose(self._cells)
        return Column(values, self._cells if odd else None, self._resolution)
