"""Reading other laboratories' files: one clear line where a file is not what was expected."""

from __future__ import annotations

import csv
import gzip
import re
import zlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gritd.tools.cli.command import DAMAGED, USAGE, CommandError

Array = NDArray[np.float64]
LARGEST = 1e15  # no number of a rig's log is beyond: counts of it must fit into 64 bits
Table = dict[str, list[str]]


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
        {file for path in paths for file in _below(path)}, key=lambda file: (file.name, str(file))
    )
    matches = ((file, pattern.fullmatch(file.name)) for file in files)
    return [(file, match) for file, match in matches if match]


def _below(path: Path) -> Iterator[Path]:
    if not path.exists():
        raise RigFileError(f"{path}: found nothing there; expected a file or a folder", USAGE)
    yield from (path.rglob("*") if path.is_dir() else [path])


def read_text(path: Path) -> str:
    """Text of a plain or gzipped file. Raises RigFileError."""
    try:
        data = path.read_bytes()
        return (gzip.decompress(data) if path.suffix == ".gz" else data).decode("utf-8-sig")
    except (OSError, EOFError, zlib.error) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise RigFileError(
            f"{path}: cannot be read: {reason}; expected a text file, plain or gzipped"
        ) from None
    except UnicodeDecodeError:
        raise RigFileError(
            f"{path}: found bytes that are not UTF-8; expected a text file"
        ) from None


def read_table(path: Path, columns: Sequence[str]) -> Table:
    """The named columns of a CSV file with a header, as text, at least one row. Raises
    RigFileError.
    """
    reader = csv.DictReader(line for line in read_text(path).splitlines() if line.strip())
    missing = [name for name in columns if name not in (reader.fieldnames or ())]
    if missing:
        raise RigFileError(
            f"{path}: found no column {missing[0]}; expected the columns {', '.join(columns)}"
        )

    table: Table = {name: [] for name in columns}
    for number, row in enumerate(reader, start=2):
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


def numbers(path: Path, table: Table, name: str) -> Array:
    """One column as finite numbers, shape (n,). Raises RigFileError naming the row."""
    return np.array(
        [
            finite_number(path, f"row {row}: {name}", text)
            for row, text in enumerate(table[name], start=2)
        ]
    )


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
    lines = [line for line in read_text(path).splitlines() if line.strip()][skip:]
    rows = [line.split(",")[:columns] for line in lines]

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
