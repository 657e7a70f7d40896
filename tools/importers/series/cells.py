"""Cells of a text table as numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from gritd.tools.importers.files import Array
from gritd.tools.importers.series.times import FOREIGN, is_gap

THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")


class OddCell(ValueError):
    """A cell that is neither a number nor a gap; `at` is its row among those that were given."""

    def __init__(self, at: int, cell: str) -> None:
        super().__init__(f"found {cell.strip()[:40]!r}")
        self.at = at


def number(cell: str) -> float | None:
    """A number with a decimal point or comma, NaN where there is a gap; None where the cell is
    neither.
    """
    text = cell.strip()
    if not NUMBER.fullmatch(text):
        if is_gap(text):
            return math.nan
        text = text.translate(FOREIGN)
        if not NUMBER.fullmatch(text):
            return None
    value = float(text)
    return value if math.isfinite(value) else math.nan


def numbers(cells: Sequence[str], commas: bool = True) -> Array:
    """Numbers (n,), NaN in a gap. `commas`: whether a comma can only be a decimal one; it may also
    part thousands where the fields are between commas. Raises OddCell.
    """
    try:
        values = np.array([float(cell) if cell else math.nan for cell in cells])
        if not any("_" in cell for cell in cells):  # which Python allows between digits
            return np.where(np.isfinite(values), values, math.nan)
    except ValueError:  # a decimal comma, a gap in words
        pass
    if not commas:
        _check_commas(cells)
    return np.array([_required(at, cell) for at, cell in enumerate(cells)])


def _check_commas(cells: Sequence[str]) -> None:
    """Raises OddCell where every comma may part thousands."""
    some = [at for at, cell in enumerate(cells) if "," in cell]
    if some and all(THOUSANDS.fullmatch(cells[at].strip()) for at in some):
        raise OddCell(some[0], cells[some[0]])


def _required(at: int, cell: str) -> float:
    if (value := number(cell)) is None:
        raise OddCell(at, cell)
    return value


def loose(cells: Sequence[str]) -> tuple[Array, bool]:
    """Numbers (n,), NaN where there is none, and whether a cell is neither number nor gap."""
    found = [number(cell) for cell in cells]
    return np.array([math.nan if x is None else x for x in found]), None in found


def last_digit(cells: Sequence[str]) -> float:
    """The finest digit that any of the numbers writes; 0 where there is none."""
    texts = (cell.strip().translate(FOREIGN).lower() for cell in cells)
    places = [_place(text) for text in texts if NUMBER.fullmatch(text)]
    return float(10.0 ** min(places)) if places else 0.0


def _place(text: str) -> int:
    mantissa, _, exponent = text.partition("e")
    return int(exponent or 0) - len(mantissa.partition(".")[2])
