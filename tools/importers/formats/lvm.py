"""LabVIEW's measurement files (.lvm): text with headers of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np

from gritd.tools.importers.files import Array, RigFileError, lines
from gritd.tools.importers.formats.made import check_size, since, table
from gritd.tools.importers.series.columns import SeriesTable, Wanted

BEGINS = "LabVIEW Measurement"
ENDS = "***End_of_Header***"
SPECIAL = "***Start_Special***"  # blocks of other programs, not of channels
NO_SPECIAL = "***End_Special***"
X = "X_Value"
COMMENT = "Comment"
SEPARATORS = {"tab": "\t", "comma": ","}
SINCE_1904 = 2_082_844_800  # [s] of 1970: LabVIEW's absolute times count from 1904
Fields = dict[str, list[str]]


@dataclass
class LvmSegment:
    """The fields of a segment's header, the names of its columns, and its rows."""

    header: Fields
    names: list[str] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)


def read(path: Path, wanted: Wanted) -> list[SeriesTable]:
    """The channels by name; segments with the same channels follow on each other. The clock is that
    of the first column, or of what the header says of the first sample and the interval. Where
    every channel has an X of its own, that is its clock. Raises RigFileError.
    """
    text = lines(path)
    if not (first := next(text, "")).startswith(BEGINS):
        raise RigFileError(f"{path}: found {first[:40]!r}; expected {BEGINS}")

    common, separator = _common(path, text)
    decimal = common.get("Decimal_Separator", ["."])[0]
    segments = [each for each in _segments(path, text, separator) if each.rows]
    if not segments:
        raise RigFileError(f"{path}: found no samples; expected some below {ENDS}")
    check_size(path, sum(len(each.rows) * len(each.names) for each in segments), "values")
    return list(_tables(path, common, segments, decimal, wanted))


def _common(path: Path, text: Iterator[str]) -> tuple[Fields, str]:
    """The header of the file, and what separates its fields."""
    header: Fields = {}
    separator = "\t"
    for line in text:
        if line.startswith(ENDS):
            return header, separator
        name = line.split("\t")[0].split(",")[0].strip()
        given = line.strip()[len(name) + 1 :].strip(" \t,\r\n") if name == "Separator" else ""
        separator = SEPARATORS.get(given.lower(), separator)
        header[name] = [cell.strip() for cell in line.split(separator)[1:]]
    raise RigFileError(f"{path}: found no {ENDS}; expected it below the header")


def _segments(path: Path, text: Iterator[str], separator: str) -> Iterator[LvmSegment]:
    """The segments, each of a header of its own. A line that is none of its rows is left out."""
    header: Fields = {}
    segment, special = LvmSegment({}), False
    for line in text:
        cells = [cell.strip() for cell in line.rstrip("\r\n").split(separator)]
        if cells[0] in (SPECIAL, NO_SPECIAL):
            special = cells[0] == SPECIAL
        elif cells[0] == ENDS:
            yield segment
            segment, header = LvmSegment(header), {}
        elif cells[0] == X or (not segment.names and X in cells):
            segment.names = cells
        elif not special and cells[0] and not _is_row(cells):
            header[cells[0]] = cells[1:]
        elif not special and segment.names:
            segment.rows.append(cells)
    yield segment


def _is_row(cells: Sequence[str]) -> bool:
    """Whether it begins as a row of samples does: with a number, or with nothing."""
    try:
        float(cells[0].replace(",", ".") or "0")
    except ValueError:
        return False
    return True


def _tables(
    path: Path, common: Fields, segments: Sequence[LvmSegment], decimal: str, wanted: Wanted
) -> Iterator[SeriesTable]:
    names, kind = segments[0].names, common.get("X_Columns", ["One"])[0].lower()
    blocks = [_numbers(path, each, decimal) for each in segments if each.names == names]
    channels = [at for at, name in enumerate(names) if name not in (X, COMMENT, "")]
    units = _units(segments[0].header, names, channels)

    if kind == "multi":
        yield from _own_clocks(path, names, np.concatenate(blocks), units, wanted)
        return

    chosen = [segment for segment in segments if segment.names == names]
    clocks = [
        block[:, 0] if kind == "one" else _regular(path, segment.header, len(block))
        for segment, block in zip(chosen, blocks, strict=True)
    ]
    whole = np.concatenate(blocks)
    arrays = {names[at]: whole[:, at] for at in channels if wanted.has(names[at])}
    clock = _joined(clocks, [_begins(s.header) or _begins(common) for s in chosen])
    yield table(path, arrays, units=units, clock=since(clock))


def _joined(clocks: Sequence[Array], begins: Sequence[float]) -> Array:
    """The times of all segments [s], since 1970 where the file says when it began. Each counts from
    its own date where it does not go on from the one before.
    """
    whole = np.concatenate(clocks)
    if whole[0] > SINCE_1904:
        return whole - SINCE_1904
    if np.all(np.diff(whole) > 0.0):
        return begins[0] + whole
    return np.concatenate([start + each for start, each in zip(begins, clocks, strict=True)])


def _own_clocks(
    path: Path, names: Sequence[str], whole: Array, units: dict[str, str], wanted: Wanted
) -> Iterator[SeriesTable]:
    """A table for each channel, whose clock is the column of X before it."""
    for at, name in enumerate(names):
        if at and names[at - 1] == X and name != X and wanted.has(name):
            known = np.isfinite(whole[:, at - 1])
            clock = since(whole[known, at - 1])
            yield table(path, {name: whole[known, at]}, units=units, clock=clock)


def _numbers(path: Path, segment: LvmSegment, decimal: str) -> Array:
    """The samples (n, columns), NaN where there is none. Raises RigFileError."""
    width = len(segment.names)
    rows = [(row + [""] * width)[:width] for row in segment.rows]
    text = np.array(rows, dtype=object)
    for at, name in enumerate(segment.names):
        if name == COMMENT:
            text[:, at] = ""
    flat = [(cell.replace(",", ".") if decimal == "," else cell) or "nan" for cell in text.ravel()]

    try:
        return np.array(flat, np.float64).reshape(text.shape)
    except ValueError as error:
        raise RigFileError(f"{path}: {error}; expected numbers below {X}") from None


def _units(header: Fields, names: Sequence[str], channels: Sequence[int]) -> dict[str, str]:
    labels = header.get("Y_Unit_Label", [])
    return {names[at]: label for at, label in zip(channels, labels, strict=False) if label}


def _regular(path: Path, header: Fields, rows: int) -> Array:
    """The times of samples without a column of them [s]. Raises RigFileError."""
    try:
        first, step = (float(header[key][0].replace(",", ".")) for key in ("X0", "Delta_X"))
    except (KeyError, IndexError, ValueError):
        raise RigFileError(
            f"{path}: found no X0 and Delta_X in the header; expected them, or a column {X}"
        ) from None
    return np.asarray(first + step * np.arange(rows))


def _begins(header: Fields) -> float:
    """When a header says that it was written [s since 1970]; 0 where it does not say."""
    try:
        date, time = header["Date"][0], header["Time"][0].replace(",", ".")[:15]
        return datetime.fromisoformat(f"{date.replace('/', '-')}T{time}+00:00").timestamp()
    except (KeyError, IndexError, ValueError):
        return 0.0
