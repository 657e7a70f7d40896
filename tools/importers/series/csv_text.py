"""CSV as laboratories write it: any of three separators, decimal commas, a preamble, a row of
units, empty cells.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from gritd.estimator.limits import limits, raised
from gritd.tools.importers.files import LARGEST, RigFileError, lines
from gritd.tools.importers.series.columns import Column, SeriesTable
from gritd.tools.importers.series.times import is_gap

NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
SEPARATORS = (",", ";", "\t")
PREAMBLE = 50  # lines among which the header is looked for

Rows = list[list[str]]


def read(path: Path) -> SeriesTable:
    """The columns of a CSV file, plain or gzipped. Raises RigFileError."""
    text = list(lines(path))
    separator, start = _layout(path, text)
    decimal = "," if separator == ";" and _has_decimal_commas(text[start + 1 :]) else "."

    rows = _split(path, text[start:], separator)
    header, body = next(rows), list(rows)
    named = _names(path, header, body)

    units = _units(header, body, decimal)
    body = body[1:] if units else body
    first = start + 2 + bool(units)
    _check(path, named, body, first)

    columns = {
        name: _column(path, name, [row[at].strip() for row in body], decimal, first)
        for at, name in named.items()
    }
    return SeriesTable(path, columns, units, np.arange(first, first + len(body)))


def _layout(path: Path, text: Sequence[str]) -> tuple[str, int]:
    """Separator and the line of the header: the first line with as many fields as the lines below
    it, two or more. Raises RigFileError.
    """
    for at in range(min(len(text) - 1, PREAMBLE)):
        for separator in SEPARATORS:
            fields, below = text[at].count(separator), _fields_below(text[at + 1], separator)
            if fields in below and fields and _is_header(text[at]):
                return separator, at

    if text and len(text) <= PREAMBLE and _is_header(text[-1]) and re.search(r"[,;\t]", text[-1]):
        raise RigFileError(f"{path}: found no rows; expected data under {text[-1].strip()[:80]}")
    raise RigFileError(
        f"{path}: found no header; expected names of columns, separated by ',', ';' or tabs"
    )


def _fields_below(line: str, separator: str) -> tuple[int, int]:
    """How many separators a row has, with those that end it and without."""
    return line.count(separator), line.rstrip(separator + " \r\n").count(separator)


def _is_header(line: str) -> bool:
    """A line whose first field is no number."""
    first = re.split(r"[,;\t]", line)[0].strip().strip('"')
    return not line.startswith("#") and not NUMBER.fullmatch(first)


def _has_decimal_commas(text: Sequence[str]) -> bool:
    return any(re.search(r"\d,\d", line) for line in text[:20])


def _split(path: Path, text: Sequence[str], separator: str) -> Iterator[list[str]]:
    try:
        yield from csv.reader(text, delimiter=separator)
    except csv.Error as error:
        raise RigFileError(f"{path}: found no CSV: {error}; expected a table") from None


def _names(path: Path, header: Sequence[str], body: Rows) -> dict[int, str]:
    """The names of the columns by place. A column without a name, such as the index that pandas
    writes, is called by its place; one without content too is left out. Raises RigFileError.
    """
    names = [name.strip() for name in header]
    for number, row in enumerate(body, start=1):
        if any(cell.strip() for cell in row[len(names) :]):
            raise RigFileError(
                f"{path}: line {number} below the header: found {len(row)} fields; "
                f"expected {len(names)}"
            )

    filled = {at for row in body for at, cell in enumerate(row[: len(names)]) if cell.strip()}
    named = {
        at: name or f"column {at + 1}" for at, name in enumerate(names) if name or at in filled
    }
    given = list(named.values())
    if twice := next((name for name in given if given.count(name) > 1), ""):
        raise RigFileError(
            f"{path}: found the column {twice!r} twice; expected each column with its own name"
        )
    return named


def _units(header: Sequence[str], body: Rows, decimal: str) -> dict[str, str] | None:
    """The row of units below the header, if there is one: words where the next row has numbers."""
    if len(body) < 2:
        return None
    named, below = ([bool(_number(cell, decimal)) for cell in row] for row in body[:2])
    if any(named) or not any(below):
        return None
    cells = zip(header, body[0], strict=False)
    return {name.strip(): cell.strip(" []()") for name, cell in cells if name.strip()}


def _check(path: Path, named: Mapping[int, str], body: Rows, first: int) -> None:
    """Every row has all fields, and the whole is no more than a log has. Raises RigFileError."""
    if not body:
        raise RigFileError(
            f"{path}: found no rows; expected data under {', '.join(named.values())}"
        )
    if len(body) * len(named) > (most := limits().values):
        raise RigFileError(f"{path}: found more than {most:g} values; {raised('values')}")

    expected = max(named) + 1
    for number, row in enumerate(body, start=first):
        if len(row) < expected:
            raise RigFileError(
                f"{path}: row {number}: found {len(row)} fields; expected {expected}"
            )


def _column(path: Path, name: str, cells: list[str], decimal: str, first: int) -> Column:
    """Numbers where every cell is one or empty; words where none is a number. Raises RigFileError
    where both stand in one column.
    """
    matches = [_number(cell, decimal) for cell in cells]
    odd = [
        at
        for at, (cell, match) in enumerate(zip(cells, matches, strict=True))
        if match is None and not is_gap(cell)
    ]
    if odd and not any(matches):
        return Column(np.full(len(cells), math.nan), cells)
    if odd:
        raise RigFileError(
            f"{path}: row {first + odd[0]}: {name}: found {cells[odd[0]][:40]!r}; "
            "expected a number, or nothing where there is a gap"
        )

    values = np.array([math.nan if m is None else float(m) for m in matches])
    if np.any(np.abs(values) > LARGEST):
        row = first + int(np.argmax(np.abs(values) > LARGEST))
        raise RigFileError(f"{path}: row {row}: {name}: expected a number up to {LARGEST:g}")
    return Column(values, resolution=_last_digit([m for m in matches[:2000] if m]))


def _number(cell: str, decimal: str) -> str | None:
    """The text of a number with a decimal point, or None."""
    text = cell.strip()
    if decimal == ",":
        text = text.replace(",", ".")
    return text if NUMBER.fullmatch(text) else None


def _last_digit(texts: Sequence[str]) -> float:
    """The finest digit that any of the numbers writes; 0 where there is none."""
    places = [_place(text) for text in texts]
    return 10.0 ** min(places) if places else 0.0


def _place(text: str) -> int:
    mantissa, _, exponent = text.lower().partition("e")
    return int(exponent or 0) - len(mantissa.partition(".")[2])
