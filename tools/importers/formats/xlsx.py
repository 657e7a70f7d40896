"""Sheets of XLSX, XLS, XLSB and ODS files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, date, datetime, time, timedelta
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.formats.made import check_size, reading
from gritd.tools.importers.series.columns import Column, SeriesTable, Wanted

PREAMBLE = 50  # rows among which the header is looked for
Rows = list[list[Any]]


def read(path: Path, wanted: Wanted) -> list[SeriesTable]:
    """The columns of each sheet that has a header and numbers below it: `sheet.column`. Raises
    RigFileError.
    """
    with reading(path, "a spreadsheet"):
        book = import_module("python_calamine").CalamineWorkbook.from_path(path)
        sheets = {name: book.get_sheet_by_name(name) for name in book.sheet_names}
        check_size(path, sum(sheet.height * sheet.width for sheet in sheets.values()), "values")
        rows = {name: sheet.to_python(skip_empty_area=False) for name, sheet in sheets.items()}

    tables = [made for name, own in rows.items() for made in _table(path, name, own, wanted)]
    if not tables:
        raise RigFileError(
            f"{path}: found no header with numbers below it; expected a sheet with names of columns"
        )
    return tables


def _table(path: Path, sheet: str, rows: Rows, wanted: Wanted) -> Iterator[SeriesTable]:
    """The table of a sheet; none where there is none."""
    at = _header(rows)
    if at is None:
        return
    names = [str(cell).strip() for cell in rows[at]]
    body = rows[at + 1 :]
    units = _units(names, body)
    body = body[1:] if units is not None else body
    while body and not any(_is_filled(cell) for cell in body[-1]):
        body.pop()

    columns = {}
    for place, name in enumerate(names):
        full = f"{sheet}.{name or f'column {place + 1}'}"
        cells = [row[place] for row in body]
        if not any(_is_filled(cell) for cell in cells) or not wanted.has(full, sheet):
            continue
        if full in columns:
            raise RigFileError(
                f"{path}: {sheet}: found the column {name!r} twice; expected each with its own name"
            )
        columns[full] = _column(cells)

    by_column = {f"{sheet}.{name}": unit for name, unit in (units or {}).items()}
    first = at + 2 + (units is not None)
    if columns:
        lines = np.arange(first, first + len(body))
        yield SeriesTable(path, columns, by_column or None, lines, group=sheet)


def _header(rows: Rows) -> int | None:
    """The row of the header: the first of words alone, two or more or all of those below, with
    numbers within the next two rows.
    """
    for at in range(min(len(rows) - 1, PREAMBLE)):
        filled = [cell for cell in rows[at] if _is_filled(cell)]
        words = bool(filled) and all(isinstance(cell, str) for cell in filled)
        below = [_places(row) for row in rows[at + 1 : at + 3]]
        here = {place for place, cell in enumerate(rows[at]) if _is_filled(cell)}
        if words and any(len(places) >= min(2, len(here)) and places <= here for places in below):
            return at
    return None


def _places(row: Sequence[Any]) -> set[int]:
    """Where a row has numbers or instants; nowhere reads as everywhere else."""
    return {at for at, cell in enumerate(row) if _is_filled(cell) and not isinstance(cell, str)}


def _is_filled(cell: Any) -> bool:
    return not (isinstance(cell, str) and not cell.strip())


def _units(names: Sequence[str], body: Rows) -> dict[str, str] | None:
    """The row of units below the header, if there is one: words above numbers."""
    if len(body) < 2 or _places(body[0]) or not _places(body[1]):
        return None
    cells = zip(names, body[0], strict=True)
    return {name: str(cell).strip(" []()") for name, cell in cells if name and _is_filled(cell)}


def _column(cells: Sequence[Any]) -> Column:
    """Numbers where all cells are, or are empty; instants as seconds since 1970, spans and times of
    day as seconds; else words.
    """
    try:
        return Column(np.array([_number(cell) for cell in cells]))
    except ValueError:
        return Column(np.full(len(cells), np.nan), [str(cell) for cell in cells])


def _number(cell: Any) -> float:
    """Raises ValueError for a word."""
    if isinstance(cell, str):
        if cell.strip() and not cell.startswith("#"):  # an error such as #DIV/0! is a gap
            return float(cell)
        return float("nan")
    if isinstance(cell, datetime):
        return cell.replace(tzinfo=UTC).timestamp()
    if isinstance(cell, date):
        return datetime(cell.year, cell.month, cell.day, tzinfo=UTC).timestamp()
    if isinstance(cell, time):
        return cell.hour * 3600.0 + cell.minute * 60.0 + cell.second + cell.microsecond * 1e-6
    return cell.total_seconds() if isinstance(cell, timedelta) else float(cell)
