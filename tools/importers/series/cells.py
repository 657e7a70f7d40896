"""Cells of a text table as numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import numpy as np

from gritd.tools.importers.files import Array
from gritd.tools.importers.series.times import FOREIGN, is_gap

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


def numbers(cells: Sequence[str]) -> Array:
    """Numbers (n,), NaN in a gap. Raises OddCell."""
    try:
        values = np.array([float(cell) if cell else math.nan for cell in cells])
        if not any("_" in cell for cell in cells):  # which Python allows between digits
            return np.where(np.isfinite(values), values, math.nan)
    except ValueError:  # a decimal comma, a gap in words
        pass
    return np.array([_required(at, cell) for at, cell in enumerate(cells)])


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
