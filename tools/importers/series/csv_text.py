"""Tables of time series as text: the columns that are wanted, block by block."""

from __future__ import annotations

import csv
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.limits import limits, raised
from gritd.tools.importers.files import LARGEST, RigFileError
from gritd.tools.importers.series.cells import OddCell
from gritd.tools.importers.series.columns import Advance, SeriesTable, no_column, row_numbers
from gritd.tools.importers.series.dialect import Layout, is_value, joined, layout, split
from gritd.tools.importers.series.mapping import Mapped
from gritd.tools.importers.series.text_columns import (
    Builder,
    Growing,
    Loose,
    NumberColumn,
    Times,
    Words,
)
from gritd.tools.importers.series.text_file import TextFile, text_file
from gritd.tools.importers.series.times import TimeFormatError, is_gap

HEAD = 10  # lines that are looked at, or more
FIRST = 2000  # rows that tell the last digit of a column
GUESSED = 1_000_000  # cells that are enough for a proposal
ZEROS = "zero bytes, as a loss of power leaves them"
CUT = "cut in the row"
HEADER = "the header again"
WORDS = "no number in it"
Rows = list[list[str]]


def read(
    path: Path,
    columns: Mapping[str, Mapped] | None = None,
    rows: int | None = None,
    advance: Advance | None = None,
) -> SeriesTable:
    """The columns that a map names; without one all columns. `rows`: so many are enough. Raises
    RigFileError.
    """
    with text_file(path) as text:
        head = _head(path, text)
        form, begin = _form(path, head, columns or ())
        lines, first = head[begin:], begin + 1
        table = _Table(path, form, _builders(form, lines, columns))
        most = None if rows is None else min(rows, max(GUESSED // form.width, HEAD))
        while lines and (most is None or table.rows < most):
            table.add(lines[:most], first, text)
            first += len(lines)
            if advance is not None:
                advance(text.position)
            lines = text.block()
        return table.whole(text.cut)


def _head(path: Path, text: TextFile) -> list[str]:
    """The first lines. Raises RigFileError where there are none."""
    head: list[str] = []
    while len(head) < HEAD and (lines := text.block()):
        head += lines
    if not head:
        found = f"cannot be read: {text.cut}" if text.cut else "found nothing in it"
        raise RigFileError(f"{path}: {found}; expected a table")
    return head


def _form(path: Path, head: Sequence[str], wanted: Collection[str]) -> tuple[Layout, int]:
    """How a table is written, and the line in which its rows begin. Raises RigFileError where it
    lacks a column that is wanted.
    """
    rows = list(joined(head))
    form = layout(path, [line for _, line in rows], wanted)
    missing = next((name for name in wanted if not form.places(name)), None)
    if missing is not None:
        known = [name or f"column {at}" for at, name in enumerate(form.names, start=1)]
        raise no_column(path, missing, known)
    return form, rows[form.start][0]


def _builders(
    form: Layout, lines: Sequence[str], columns: Mapping[str, Mapped] | None
) -> dict[tuple[str, int], Builder]:
    """What becomes of each column, by its name and place; one whose name stands there twice is read
    twice.
    """
    first = _first(form, lines)
    if columns is None:
        return {(name, at): Loose(first[at]) for name, at in _all(form, first)}

    made: dict[tuple[str, int], Builder] = {}
    for name, column in columns.items():
        for at in form.places(name):
            if column.channel == "run":
                made[name, at] = Words()
            else:
                timed = column.channel in ("time", "date")
                numbers = NumberColumn(first[at], form.separator != ",")
                made[name, at] = Times(column) if timed else numbers
    return made


def _first(form: Layout, lines: Sequence[str]) -> list[tuple[str, ...]]:
    """Some cells of every column."""
    rows: Rows = []
    for line in lines[:FIRST]:
        fields = _fields(line, form.separator)
        if len(fields) == form.width:
            rows.append(fields)
    columns = list(zip(*rows, strict=True))
    return columns + [()] * (len(form.names) - len(columns))


def _all(form: Layout, first: Sequence[Sequence[str]]) -> Iterator[tuple[str, int]]:
    """Name and place of every column: its own name, `column 3` where it has none or another has it;
    without name and content it is none.
    """
    seen: set[str] = set()
    for at, name in enumerate(form.names[: form.width]):
        if name and name not in seen:
            yield name, at
        elif name or any(cell.strip() for cell in first[at]):
            yield f"column {at + 1}", at
        seen.add(name)


def _fields(line: str, separator: str) -> list[str]:
    """The fields of a line; none of one that cannot be parted."""
    try:
        return split(line, separator)
    except csv.Error:
        return []


def _begun(lines: Sequence[str], separator: str, last: int) -> Rows:
    """The fields of lines without quotes, up to the one at `last`; of some more between blanks."""
    if separator == " ":
        return [line.split() for line in lines]
    return [line.rstrip("\n").split(separator, last + 1) for line in lines]


class _Table:
    """Rows to columns. What cannot be read is left out, and reported."""

    def __init__(self, path: Path, form: Layout, columns: dict[tuple[str, int], Builder]) -> None:
        self._path, self._form, self._columns = path, form, columns
        self._plain = {at: made for (_, at), made in columns.items() if made.numeric}
        self._places = [at for _, at in columns]
        self._needed = max((at for _, at in columns), default=0) + 1
        self._lines = Growing(np.int64)
        self._left_out: dict[str, list[int]] = {}
        self.rows = 0

    def add(self, lines: list[str], first: int, text: TextFile) -> None:
        """Lines, the first with this number. Raises RigFileError."""
        if lines[-1].endswith("\n"):
            self._block(lines, first)
        else:
            self._block(lines[:-1], first)
            self._last(lines[-1], first + len(lines) - 1, lines[:-1], bool(text.cut))
        self._check_size(lines, first, text)

    def whole(self, cut: str) -> SeriesTable:
        """The columns, with what was left out. Raises RigFileError."""
        gone = sum(map(len, self._left_out.values()))
        if not self.rows or gone > self.rows:
            raise self._nothing(gone)

        columns = {}
        for (name, at), made in self._columns.items():
            column = made.column()
            if name not in columns:
                columns[name] = column
            elif not np.array_equal(column.numbers, columns[name].numbers, equal_nan=True):
                raise RigFileError(
                    f"{self._path}: found the column {name[:40]!r} twice, with other values; "
                    f"expected the number of the one that is meant, such as 'column {at + 1}'"
                )

        why = [f"{self._path.name}: ends within its packed data: {cut[:80]}"] if cut else []
        notes = [
            f"{self._path.name}: left out {row_numbers(rows)}: {reason}"
            for reason, rows in self._left_out.items()
        ]
        return SeriesTable(
            self._path,
            columns,
            self._form.units,
            self._lines.whole,
            tuple(notes + why),
            left_out=self._rows_left_out(),
        )

    def _rows_left_out(self) -> NDArray[np.int64]:
        """Numbers (n,) of the lines that were rows."""
        rows = [each for why, each in self._left_out.items() if why not in (HEADER, WORDS)]
        return np.array(sorted(number for each in rows for number in each), dtype=np.int64)

    # --- blocks ---

    def _block(self, lines: Sequence[str], first: int) -> None:
        if not lines:
            return
        try:
            pieces = self._uniform(lines)
        except ValueError:  # an odd cell: each row is looked at
            pieces = None
        if pieces is not None:
            self._keep(pieces, np.arange(first, first + len(lines)))
            return

        rows, numbers = self._whole_rows(lines, first)
        self._keep(self._converted(rows, numbers), np.array(numbers, dtype=np.int64))

    def _uniform(self, lines: Sequence[str]) -> dict[int, Any] | None:
        """By place what the columns become, where every line is a row without quotes; else None.
        Raises ValueError where a cell is odd.
        """
        separator, width = self._form.separator, self._form.width
        text = "".join(lines)
        if '"' in text or "\0" in text or self._needed > width:
            return None
        if separator != " " and {line.count(separator) for line in lines} != {width - 1}:
            return None

        pieces = self._plain_numbers(lines)
        rest = [(at, made) for (_, at), made in self._columns.items() if at not in pieces]
        if rest:
            rows = _begun(lines, separator, max(at for at, _ in rest))
            if separator == " " and set(map(len, rows)) != {width}:
                return None
            pieces |= {at: made.convert([row[at] for row in rows]) for at, made in rest}
        return pieces

    def _plain_numbers(self, lines: Sequence[str]) -> dict[int, Any]:
        """Columns of numbers without a gap, the quickest way; none where there are gaps."""
        separator = self._form.separator
        if not self._plain or separator == " ":
            return {}
        if separator != "," and "," in lines[0]:
            lines = [line.replace(",", ".") for line in lines]
        try:
            values = np.loadtxt(
                lines,
                delimiter=separator,
                usecols=list(self._plain),
                comments=None,
                ndmin=2,
                max_rows=len(lines),
            )
        except ValueError:
            return {}
        made = {
            at: column.plain(numbers.copy())
            for (at, column), numbers in zip(self._plain.items(), values.T, strict=True)
        }
        return {at: piece for at, piece in made.items() if piece is not None}

    # --- rows ---

    def _whole_rows(self, lines: Sequence[str], first: int) -> tuple[Rows, list[int]]:
        """The rows that have all fields, with their numbers. The others are left out."""
        rows, numbers = [], []
        for at, line in joined(lines):
            fields = _fields(line, self._form.separator)
            reason = self._reason(line, fields)
            if reason is None:
                rows.append(fields)
                numbers.append(first + at)
            elif reason:
                self._left_out.setdefault(reason, []).append(first + at)
        return rows, numbers

    def _reason(self, line: str, fields: Sequence[str]) -> str | None:
        """Why a line is no row; '' where nobody needs to know; None of a row."""
        if not line.strip(" \t\r\n\x1a" + self._form.separator):
            return ""
        if "\0" in line:
            return ZEROS
        if not fields:
            return f"a field in quotes of more than {csv.field_size_limit()} characters"
        if len(fields) < self._needed:
            comment = line.lstrip().startswith(("#", "%", "//"))
            return "" if comment else f"fewer than {self._needed} fields"
        if any(cell.strip() for cell in fields[len(self._form.names) :]):
            return f"more than {self._form.width} fields"
        if self._form.header and _stripped(fields) == _stripped(self._form.header):
            return HEADER
        cells = [fields[at].strip() for at in self._places]
        return None if any(map(is_value, cells)) or all(map(is_gap, cells)) else WORDS

    def _last(self, line: str, number: int, before: Sequence[str], cut: bool) -> None:
        """The last line, where no end of a line follows: it may be cut in a row or in a number,
        which is then shorter than any before it.
        """
        separator = self._form.separator
        fields = _fields(line, separator)
        reason = self._reason(line, fields)
        others = [_fields(other, separator)[-1:] for other in before[-FIRST:]]
        ends = [len(end[0].strip()) for end in others if end]
        short = bool(fields and ends) and len(fields[-1].strip()) < min(ends)
        try:
            if reason is None and not cut and not short and len(fields) >= self._form.width:
                pieces = {at: made.convert([fields[at]]) for (_, at), made in self._columns.items()}
                self._keep(pieces, np.array([number]))
                return
        except (OddCell, TimeFormatError):
            pass
        if reason != "":
            self._left_out.setdefault(ZEROS if "\0" in line else CUT, []).append(number)

    def _converted(self, rows: Rows, numbers: Sequence[int]) -> dict[int, Any]:
        """By place what the columns become. Raises RigFileError."""
        pieces = {}
        for (name, at), made in self._columns.items():
            try:
                pieces[at] = made.convert([row[at] for row in rows])
            except OddCell as error:
                raise RigFileError(
                    f"{self._path}: row {numbers[error.at]}: {name[:40]}: {error}; "
                    "expected a number such as 1234.5, or nothing where there is a gap"
                ) from None
            except TimeFormatError as error:
                row = numbers[error.at] if numbers else 0
                raise RigFileError(f"{self._path}: row {row}: {name[:40]}: {error}") from None
        return pieces

    def _keep(self, pieces: dict[int, Any], numbers: NDArray[np.int64]) -> None:
        for (name, at), made in self._columns.items():
            if isinstance(made, NumberColumn) and np.any(far := np.abs(pieces[at]) > LARGEST):
                row = int(numbers[np.argmax(far)])
                raise RigFileError(
                    f"{self._path}: row {row}: {name[:40]}: expected a number up to {LARGEST:g}"
                )
            made.keep(pieces[at])
        self._lines.add(numbers)
        self.rows += numbers.size

    # --- refusals ---

    def _check_size(self, lines: Sequence[str], first: int, text: TextFile) -> None:
        """Raises RigFileError where the values are more than can be kept, at the first block
        already where the size of the file tells it.
        """
        most, columns = limits().series, len(self._columns)
        rows = float(self.rows)
        if self.rows <= len(lines) and not text.packed:  # the first block
            rows *= text.size / max(sum(map(len, lines)), 1)
        if rows * columns > most:
            raise RigFileError(
                f"{self._path}: found more than {most:g} values in {columns} columns; "
                f"{raised('series')}; or cut the file into several"
            )

    def _nothing(self, gone: int) -> RigFileError:
        if not gone:
            return RigFileError(f"{self._path}: found no rows; expected data under the header")
        reason, rows = max(self._left_out.items(), key=lambda item: len(item[1]))
        return RigFileError(
            f"{self._path}: found {self.rows} whole rows and {gone} others; {row_numbers(rows)}: "
            f"{reason}; expected a table whose rows are alike"
        )


def _stripped(fields: Sequence[str]) -> list[str]:
    return [cell.strip() for cell in fields if cell.strip()]
