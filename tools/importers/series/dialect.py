"""How a text table is written: its separator, its header, its units, and where its rows begin."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

from gritd.estimator.config import units
from gritd.tools.importers.files import RigFileError
from gritd.tools.importers.series.cells import NUMBER, number
from gritd.tools.importers.series.mapping import spelled
from gritd.tools.importers.series.times import FORMS, is_gap

SEPARATORS = ("\t", ";", "|", ",", " ")  # the last: any number of blanks and tabs
COMMENT = re.compile(r"\s*(?:[#%]+|//)\s*")
LAST = 20  # rows at the end of the beginning that tell how the table is written
SHARE = 0.6  # of these with the usual number of fields
HALF = 0.5  # sense of the fields between tabs, where these part the rows
GAP = 0.9  # what a gap in words counts, relative to a value
CELLS = 100_000  # that are looked at for it
FARTHEST = 500  # lines above the rows in which the names of the map are looked for
JOINED = 20  # lines of one row, whose quotes may hold ends of lines
SOME = 1000  # fields of a line that tell for all
ABOVE = 3  # lines above the rows among which the header is looked for
MARKS = frozenset({"", "-", "--", "1/min", "1/s", "counts", "ticks", "°", "sec", "bool", "none"})
PLACE = re.compile(r"(?:column )?([1-9]\d{0,6})")

Rows = list[list[str]]


@dataclass(frozen=True)
class Layout:
    """A table's form.

    names: of the columns by place; '' where there is none. width: fields of a row.
    start: place of the first row among the lines. units: by name.
    header: the fields of the header; none where there is no header.
    """

    separator: str
    names: tuple[str, ...]
    width: int
    start: int
    units: dict[str, str]
    header: tuple[str, ...]

    def places(self, name: str) -> list[int]:
        """Where the columns of a name stand; a column may be called by its number too."""
        exact = [at for at, known in enumerate(self.names) if known == name]
        if exact:
            return exact
        number = PLACE.fullmatch(name)
        if number and (not self.header or not name.isdigit()) and int(number[1]) <= self.width:
            return [int(number[1]) - 1]
        return []


def split(line: str, separator: str) -> list[str]:
    """The fields of one line. Raises csv.Error."""
    if '"' not in line:
        return line.split() if separator == " " else line.rstrip("\n").split(separator)
    text = " ".join(line.split()) if separator == " " else line.rstrip("\n").replace("\n", " ")
    return next(csv.reader([text], delimiter=separator, skipinitialspace=True), [])


def layout(path: Path, lines: Sequence[str], wanted: Collection[str] = ()) -> Layout:
    """The form of a table, from its first lines; `wanted` are names that its header may have.
    Raises RigFileError.
    """
    asked = {name for name in wanted if not PLACE.fullmatch(name)}
    separator, rows = _separator(path, lines, asked)
    width, numeric = len(rows[0]), _numeric(rows)
    parted = (_fields(line, separator) for line in lines)
    start = next((at for at, row in enumerate(parted) if _is_row(row, width, numeric)), None)
    if start is None:
        raise _no_rows(path, lines)

    place = _header(lines, separator, start, width, asked)
    if place is None:
        return Layout(separator, ("",) * width, width, start, {}, ())

    names = _names(lines[place], separator, width)
    if len(names) == width - 1 and any(row[-1] for row in rows):
        names = ["", *names]  # the rows have numbers or names of their own
    _check_width(path, names, rows)
    below = next((line for line in lines[place + 1 : start] if line.strip("\0 \r\n")), "")
    words = [cell.strip(" []()") for cell in _names(below, separator, width)] if below else []
    whole = (*names, *[""] * (width - len(names)))
    return Layout(
        separator, whole, width, start, dict(zip(names, words, strict=False)), tuple(names)
    )


def _check_width(path: Path, names: Sequence[str], rows: Rows) -> None:
    """Raises RigFileError where rows have more fields than the header has names."""
    if any(cell for row in rows for cell in row[len(names) :]):
        raise RigFileError(
            f"{path}: found rows of {len(rows[0])} fields under a header of {len(names)}; "
            "expected as many; decimal commas need another separator than commas"
        )


def joined(lines: Sequence[str]) -> Iterator[tuple[int, str]]:
    """Rows with the place of their first line; one whose quote is open goes on in the next."""
    at = 0
    while at < len(lines):
        end, line = at + 1, lines[at]
        while line.count('"') % 2 and end < min(at + JOINED, len(lines)):
            line += lines[end]
            end += 1
        whole = line.count('"') % 2 == 0
        yield at, line if whole else lines[at]
        at = end if whole else at + 1


def _fields(line: str, separator: str) -> list[str]:
    """The fields of a line, without blanks around them; none of one that cannot be parted."""
    try:
        return [cell.strip() for cell in split(line, separator)]
    except csv.Error:
        return []


def is_value(cell: str) -> bool:
    """Whether a cell is a number or a time."""
    value = number(cell)
    return value == value if value is not None else _is_time(cell)


def _is_time(cell: str) -> bool:
    return cell[:1].isalnum() and any(form.fullmatch(cell) for form in FORMS.values())


# --- separator ---


def _separator(path: Path, lines: Sequence[str], wanted: set[str]) -> tuple[str, Rows]:
    """The separator that parts the last lines into most values, and these rows, which have as many
    fields as each other; first of those that part a header with the wanted names. Raises
    RigFileError.
    """
    options = _of_header(lines, wanted) if len(wanted) > 1 else ()
    last = [line for line in lines if line.strip("\0 \r\n\t") and "\0" not in line][-LAST - 1 :]
    last = last[:-1] if len(last) > 2 else last  # may be cut
    last = last[-max(len(last) // 2, 1) :]  # a short file has its header in the other half
    found = []
    for separator in options or SEPARATORS:
        rows = [_fields(line, separator) for line in last]
        width, count = Counter(map(len, rows)).most_common(1)[0] if rows else (0, 0)
        if width < 2 or count < SHARE * len(rows):
            continue
        rows = [row for row in rows if len(row) == width][-max(CELLS // width, 3) :]
        cells = [cell for row in rows for cell in row[:SOME]]
        found.append((sum(map(_sense, cells)) / len(cells), separator, rows))

    if not found:
        raise RigFileError(
            f"{path}: found no table; expected rows of two fields or more, separated by commas, "
            "semicolons, tabs or blanks"
        )
    tabs = any(sense > HALF for sense, separator, _ in found if separator == "\t")
    chosen = [each for each in found if not (tabs and each[1] == " ")]  # blanks within its fields
    _, separator, rows = max(chosen, key=lambda each: each[0])
    return separator, rows


def _of_header(lines: Sequence[str], wanted: set[str]) -> list[str]:
    """The separators that part one of the first lines into the wanted names."""
    first = lines[:FARTHEST]
    return [
        separator
        for separator in SEPARATORS
        if any(wanted <= set(_names(line, separator, 0)) for line in first)
    ]


def _sense(cell: str) -> float:
    """How well a cell is a field of a table of numbers: less well for a gap in words."""
    return 1.0 if is_value(cell) else GAP * bool(cell and is_gap(cell))


# --- rows ---


def _numeric(rows: Rows) -> list[int]:
    """Columns that hold numbers, times or gaps in most of some rows."""
    return [
        at
        for at, cells in enumerate(zip(*rows, strict=True))
        if any(map(is_value, cells))
        and sum(is_value(cell) or is_gap(cell) for cell in cells) > 0.5 * len(cells)
    ]


def _is_row(row: Sequence[str], width: int, numeric: Sequence[int]) -> bool:
    if len(row) != width or not numeric:
        return False
    cells = [row[at] for at in numeric]
    return any(map(is_value, cells)) and all(is_value(cell) or is_gap(cell) for cell in cells)


def _no_rows(path: Path, lines: Sequence[str]) -> RigFileError:
    last = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return RigFileError(
        f"{path}: found no rows of numbers; expected some; the last line is {last[:80]!r}"
    )


# --- header ---


def _header(
    lines: Sequence[str], separator: str, start: int, width: int, wanted: set[str]
) -> int | None:
    """Place of the header: the line above the rows that has the wanted names; else the nearest that
    has as many fields as a row, none of them a number, and is none of units.
    """
    above = [at for at in range(start) if lines[at].strip()][-FARTHEST:]
    named = {at: _names(lines[at], separator, width) for at in above}
    if wanted:
        for at in reversed(above):
            if wanted <= set(named[at]):
                return at

    near = list(takewhile(lambda at: _is_header(named[at], width), reversed(above)))[:ABOVE]
    proper = [at for at in near if not _are_units(named[at])]
    once = [at for at in proper if len(set(named[at])) > 0.5 * len(named[at])]
    return next(iter(once or proper[-1:] or near[-1:]), None)


def _names(line: str, separator: str, width: int) -> list[str]:
    """The fields of a header, which may stand behind a comment mark. Between blanks a name may hold
    blanks itself: two of them part it from the next, or a unit in brackets ends it.
    """
    text = COMMENT.sub("", line, count=1) if COMMENT.match(line) else line
    names = _fields(text, separator)
    while len(names) > width and not names[-1]:
        names.pop()
    if separator != " " or len(names) == width:
        return names

    ways = (re.split(r"\s{2,}|\t", text.strip()), re.sub(r"([\])])\s+", "\\1\n", text.strip()))
    parted = (ways[0], str(ways[1]).split("\n"))
    return next((list(way) for way in parted if len(way) == width), names)


def _is_header(names: Sequence[str], width: int) -> bool:
    """Whether the fields may be names of columns: as many as a row has, without the empty ones at
    the end, one fewer where the rows have numbers of their own, one more for a comment.
    """
    filled = len(names)
    while filled and not names[filled - 1]:
        filled -= 1
    fits = filled and (len(names) in (width - 1, width, width + 1) or filled == width)
    return bool(fits) and filled > 1 and not any(NUMBER.fullmatch(name) for name in names[:filled])


def _are_units(names: Sequence[str]) -> bool:
    some = names[:SOME]
    return sum(_is_unit(name) for name in some) > SHARE * len(some)


def _is_unit(text: str) -> bool:
    """Whether a field is a unit, in brackets or not."""
    if text.strip("[]()").lower() in MARKS or re.fullmatch(r"\[.*\]|\(.*\)", text):
        return True
    try:
        return bool(units.unit(spelled(text)).dimension)
    except units.UnitError:
        return False
