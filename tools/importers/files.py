"""Reading other laboratories' files: one clear line where a file is not what was expected."""

from __future__ import annotations

import codecs
import csv
import gzip
import os
import re
import zlib
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import BinaryIO, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.limits import limits, raised
from gritd.estimator.recording.mcapfile import opened
from gritd.tools.cli.command import DAMAGED, USAGE, CommandError

Array = NDArray[np.float64]
LARGEST = 1e15  # no number of a rig's log is beyond: counts of it must fit into 64 bits
MAX_LINE = 1 << 20  # [bytes]
CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f]")  # characters that no text has
Table = dict[str, list[str]]
Row = TypeVar("Row")


class RigFileError(CommandError):
    """A file is not what the importer expects, or (USAGE) its name is wrong; the message is one
    line naming it.
    """

    def __init__(self, message: str, code: int = DAMAGED) -> None:
        super().__init__(message, code)


def find(paths: Iterable[Path], pattern: re.Pattern[str]) -> list[tuple[Path, re.Match[str]]]:
    """Files whose name matches, in the folders and among the files given, sorted. Raises
    RigFileError.
    """
    files = sorted(
        {file for path in paths for file in below(path)}, key=lambda file: (file.name, str(file))
    )
    matches = ((file, pattern.fullmatch(file.name)) for file in files)
    return [(file, match) for file, match in matches if match]


def below(path: Path) -> Iterator[Path]:
    """A file, or everything in a folder. Raises RigFileError."""
    try:
        if not path.exists():
            raise RigFileError(f"{path}: found nothing there; expected a file or a folder", USAGE)
        if folder := path.is_dir():
            os.scandir(path).close()  # `rglob` takes one that may not be read for an empty one
    except OSError as error:
        reason = error.strerror or error
        raise RigFileError(
            f"{path}: cannot be read: {reason}; expected a file or a folder of your own", USAGE
        ) from None

    yield from (path.rglob("*") if folder else [path])


def read_text(path: Path) -> str:
    """Text of a plain or gzipped file. Raises RigFileError."""
    return "".join(_pieces(path))


def lines(path: Path) -> Iterator[str]:
    """The lines of a plain or gzipped text file that are not empty. Raises RigFileError."""
    for piece in _pieces(path):
        yield from (line for line in piece.splitlines() if line.strip())


def _pieces(path: Path) -> Iterator[str]:
    """The text up to each newline, unpacked no faster than it is used."""
    try:
        with opened(path) as file:
            for piece in _bounded(path, gzip.GzipFile(fileobj=file) if _packed(path) else file):
                yield _decoded(piece)
    except (OSError, EOFError, zlib.error) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise RigFileError(
            f"{path}: cannot be read: {reason}; expected a text file, plain or gzipped"
        ) from None
    except UnicodeDecodeError:
        raise RigFileError(f"{path}: found bytes that are no text; expected a text file") from None


def _decoded(piece: bytes) -> str:
    """UTF-8; else what Windows programs write in Western Europe. Raises UnicodeDecodeError where it
    is neither.
    """
    try:
        return piece.decode("utf-8")
    except UnicodeDecodeError:
        if CONTROL.search(piece):
            raise
        return piece.decode("cp1252")


def _packed(path: Path) -> bool:
    return path.suffix == ".gz"


def _bounded(path: Path, file: BinaryIO | gzip.GzipFile) -> Iterator[bytes]:
    """What stands up to each newline, without the mark that some programs begin a text with. Raises
    RigFileError where a line or the whole is longer than a log's.
    """
    most, size = limits().text, 0
    file = _in_bytes(file)

    while piece := file.readline(MAX_LINE + 1):
        size += len(piece)
        if len(piece) > MAX_LINE:
            raise RigFileError(f"{path}: found a line of more than {MAX_LINE} bytes")
        if size > most:
            raise RigFileError(
                f"{path}: found more than {most:.0f} bytes of text; {raised('text')}"
            )
        yield piece.removeprefix(codecs.BOM_UTF8) if size == len(piece) else piece


def _in_bytes(file: BinaryIO | gzip.GzipFile) -> BinaryIO | gzip.GzipFile:
    """The file from its beginning, one character a byte where that is ASCII: a text in UTF-16, as
    spreadsheets write "Unicode", becomes UTF-8.
    """
    begins = file.read(2)
    file.seek(0)
    if begins not in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return file
    return cast(BinaryIO, codecs.EncodedFile(file, "utf-8", "utf-16"))


def read_table(path: Path, columns: Sequence[str]) -> Table:
    """The named columns of a CSV file with a header, as text, at least one row. Raises
    RigFileError.
    """
    try:
        return _table(path, csv.DictReader(lines(path)), columns)
    except csv.Error as error:
        raise RigFileError(f"{path}: found no CSV: {error}; expected a table") from None


def _table(path: Path, reader: csv.DictReader[str], columns: Sequence[str]) -> Table:
    missing = [name for name in columns if name not in (reader.fieldnames or ())]
    if missing:
        raise RigFileError(
            f"{path}: found no column {missing[0]}; expected the columns {', '.join(columns)}"
        )

    table: Table = {name: [] for name in columns}
    for number, row in enumerate(_few(path, reader, len(columns)), start=2):
        for name in columns:
            if row[name] is None:
                raise RigFileError(
                    f"{path}: row {number}: found no {name}; "
                    f"expected {len(reader.fieldnames or ())} fields"
                )
            table[name].append(row[name])

    if not table[columns[0]]:
        raise RigFileError(f"{path}: found no rows; expected data under {', '.join(columns)}")

    return table


def _few(path: Path, rows: Iterable[Row], columns: int) -> Iterator[Row]:
    """The rows, as long as they have no more values than can be kept. Raises RigFileError."""
    most = limits().values
    for number, row in enumerate(rows, start=1):
        if number * columns > most:
            raise RigFileError(f"{path}: found more than {most:.0f} values; {raised('values')}")
        yield row


def numbers(path: Path, table: Table, name: str, rows: Sequence[int] = ()) -> Array:
    """One column as finite numbers, shape (n,). rows: their numbers in the file; from 2 on where
    none are given. Raises RigFileError naming the row.
    """
    texts = table[name]
    numbered = zip(rows or range(2, len(texts) + 2), texts, strict=True)
    return np.array([finite_number(path, f"row {row}: {name}", text) for row, text in numbered])


def finite_number(path: Path, where: str, text: str) -> float:
    """A finite number, not beyond LARGEST. Raises RigFileError."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) <= LARGEST:
        raise RigFileError(f"{path}: {where}: found {text[:40]!r}; expected a finite number")
    return value


def matrix(path: Path, columns: int, skip: int = 0) -> Array:
    """Rows of comma-separated finite numbers without a header, shape (n, columns); more columns are
    ignored.

    Raises RigFileError naming the row.
    """
    fields = (line.split(",", columns)[:columns] for line in islice(lines(path), skip, None))
    rows = list(_few(path, fields, columns))

    if not rows:
        raise RigFileError(f"{path}: found no rows; expected {columns} numbers in each")

    for place, row in enumerate(rows, start=skip + 1):
        if len(row) < columns:
            raise RigFileError(f"{path}: row {place}: found {len(row)} fields; expected {columns}")

    try:
        values = np.array(rows, dtype=float).reshape(len(rows), columns)
    except ValueError:
        values = np.array(
            [
                [finite_number(path, f"row {i}", text) for text in row]
                for i, row in enumerate(rows, skip + 1)
            ]
        )

    good = np.all(np.abs(values) <= LARGEST, axis=1)
    if not np.all(good):
        bad = int(np.argmin(good)) + skip + 1
        raise RigFileError(
            f"{path}: row {bad}: found a number that is not finite; "
            f"expected {columns} finite numbers"
        )

    return values


def increasing(path: Path, what: str, values: Array, first: int = 2) -> Array:
    """The values, shape (n,), if there are two or more and they only rise; `first` is the row they
    begin in.

    Raises RigFileError.
    """
    if len(values) < 2:
        raise RigFileError(f"{path}: found {len(values)} rows; expected a log of two or more")

    if np.any(np.diff(values) <= 0):
        row = int(np.argmax(np.diff(values) <= 0)) + first + 1
        raise RigFileError(f"{path}: row {row}: {what} does not rise; expected times in order")
    return values
