"""What the cells of a text table become, block by block: numbers, instants or words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from gritd.tools.importers.files import Array
from gritd.tools.importers.series.cells import last_digit, loose, numbers
from gritd.tools.importers.series.columns import Column
from gritd.tools.importers.series.mapping import Mapped
from gritd.tools.importers.series.stamps import TimeColumn
from gritd.tools.importers.series.times import NONE, NS, Nanoseconds


class Builder(Protocol):
    """One column in the making. `convert` raises OddCell or TimeFormatError, and keeps nothing."""

    def convert(self, cells: Sequence[str]) -> Any: ...
    def keep(self, piece: Any) -> None: ...
    def column(self) -> Column: ...


class Numbers:
    """A column of numbers; `first` are some of its cells, which tell its last digit. `commas`:
    whether a comma in it can only be a decimal one.
    """

    def __init__(self, first: Sequence[str], commas: bool) -> None:
        self._commas = commas
        self._pieces: list[Array] = []
        self._resolution = last_digit(first)

    def convert(self, cells: Sequence[str]) -> Array:
        return numbers(cells, self._commas)

    def keep(self, piece: Array) -> None:
        self._pieces.append(piece)

    def column(self) -> Column:
        return Column(joined(self._pieces), resolution=self._resolution)


class Times:
    """A column of time or of dates."""

    def __init__(self, mapped: Mapped) -> None:
        self._time = TimeColumn(mapped)
        self._pieces: list[Nanoseconds] = []

    def convert(self, cells: Sequence[str]) -> Nanoseconds:
        return self._time.read(cells)

    def keep(self, piece: Nanoseconds) -> None:
        self._pieces.append(piece)

    def column(self) -> Column:
        instants = joined(self._pieces)
        seconds = np.where(instants == NONE, math.nan, instants / NS)
        return Column(seconds, instants=instants, period=self._time.period)


class Words:
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


class Loose:
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


def joined(pieces: list[Any]) -> Any:
    """Arrays (n,) end to end; the pieces are gone."""
    whole = np.concatenate(pieces) if pieces else np.empty(0)
    pieces.clear()
    return whole
