"""Which files are which run, and what is used of each: tables with a clock."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.nearest import listed
from gritd.tools.cli.command import USAGE
from gritd.tools.importers.files import LARGEST, RigFileError, below
from gritd.tools.importers.formats import registry
from gritd.tools.importers.formats.made import common
from gritd.tools.importers.series import csv_text
from gritd.tools.importers.series.columns import (
    EVERYTHING,
    Advance,
    Column,
    SeriesTable,
    Wanted,
    no_column,
)
from gritd.tools.importers.series.mapping import CLOCK, DATE, TIME, Mapped, MapSource, SeriesMap

TEXTS = (".csv", ".txt", ".tsv", ".tab", ".dat", ".asc")
PACKED = r"(\.(gz|zst|zip|xz|bz2))?$"
SERIES = re.compile(
    f"({'|'.join(map(re.escape, (*TEXTS, *registry.ENDINGS)))}){PACKED}", re.IGNORECASE
)
ENDING = re.compile(f"({SERIES.pattern.removesuffix(PACKED)})?{PACKED}", re.IGNORECASE)
FEW = 3  # rows of a table that is one
SAMPLE = Wanted(rows=100)  # to tell what a file holds

CLOCKS = (DATE, TIME)  # channels that tell when a row was taken
OWN_CLOCK = "time of the file"  # what a clock that is no column is called in messages

Place = tuple[int, str]  # number of a table, and a column's name in it


@dataclass(frozen=True)
class RunFiles:
    """The files of one run, each with what is used of it."""

    name: str
    files: tuple[tuple[MapSource, Path], ...]


@dataclass(frozen=True)
class SourcePart:
    """Columns of one clock, by the map's labels, with what the map says of them alone.

    shift: [s] is added to the times.
    """

    table: SeriesTable
    mapped: SeriesMap
    shift: float


def read(
    path: Path,
    wanted: Wanted = EVERYTHING,
    columns: Mapping[str, Mapped] | None = None,
    advance: Advance | None = None,
) -> list[SeriesTable]:
    """The tables of one file, by what it is; `columns` is what the map says of those of a text.
    Raises RigFileError.
    """
    if not path.exists():
        raise RigFileError(f"{path}: found nothing there; expected a file", USAGE)
    tables = registry.read(path, wanted)
    return [csv_text.read(path, columns, wanted.rows, advance)] if tables is None else tables


def stem(name: str) -> str:
    """A file's name without what says its kind."""
    return ENDING.sub("", name, count=1)


# --- which files ---


def series_files(paths: Iterable[Path], left_out: list[str] | None = None) -> list[Path]:
    """The files that are given, and those of the folders that may hold series; the folder of a ROS
    2 bag counts as a file. Texts of a folder that are no tables are left out, with a line each.
    Raises RigFileError.
    """
    found = list(dict.fromkeys(file for path in paths for file in _files(path)))
    kept = [path for path in found if path in paths or _may_be_table(path)]
    if not kept:
        raise RigFileError(f"{found[0]}: found no table, nor any beside it; expected some", USAGE)
    if left_out is not None:
        left_out += [f"{path.name} is no table and left out" for path in found if path not in kept]
    return kept


def _may_be_table(path: Path) -> bool:
    """Whether a file of a folder is more than a text: one that describes the others."""
    if path.suffix.lower() not in TEXTS or not path.stat().st_size:
        return True
    try:
        return csv_text.read(path, None, SAMPLE.rows).rows >= FEW
    except RigFileError:
        return False


def _files(path: Path) -> list[Path]:
    if not path.is_dir() or (path / "metadata.yaml").exists():
        return [path]
    bags = {file.parent for file in path.rglob("metadata.yaml")}
    inside = (file for file in below(path) if file.is_file() and not bags & set(file.parents))
    files = sorted([*bags, *(file for file in inside if SERIES.search(file.name))])
    if not files:
        raise RigFileError(f"{path}: found no file that may hold series; expected some", USAGE)
    return files


def runs_files(
    paths: Sequence[Path], mapped: SeriesMap, left_out: list[str] | None = None
) -> list[RunFiles]:
    """The files of each run; a line for each text that is no table. Raises RigFileError."""
    files = series_files(paths, left_out)
    (first, *more) = mapped.sources
    if not first.pattern:
        return [RunFiles(stem(path.name), ((first, path),)) for path in files]

    found: dict[str, dict[str, Path]] = {}
    for path in files:
        if match := _matched(path, mapped.sources):
            source, run = match
            other = found.setdefault(run, {}).setdefault(source.pattern, path)
            if other != path:
                raise RigFileError(
                    f"files: found {other} and {path} for {source.pattern!r} of the run {run!r}; "
                    "expected one",
                    USAGE,
                )
        elif path in paths:
            raise RigFileError(
                f"{path}: found no such name among files:; expected one of "
                f"{', '.join(source.pattern for source in mapped.sources)}",
                USAGE,
            )
    return [_complete(run, own, (first, *more)) for run, own in found.items()]


def _matched(path: Path, sources: Sequence[MapSource]) -> tuple[MapSource, str] | None:
    """The source whose pattern a file's name fits, and its run: what stands for the `*`, else the
    name of the folder.
    """
    for source in sources:
        pattern = "(.*)".join(map(re.escape, source.pattern.split("*")))
        if match := re.fullmatch(pattern, path.name):
            stars = "_".join(text for text in match.groups() if text).strip("_-. ")
            return source, stars or path.resolve().parent.name
    return None


def _complete(run: str, own: Mapping[str, Path], sources: Sequence[MapSource]) -> RunFiles:
    """Raises RigFileError where a run lacks a file."""
    for source in sources:
        if source.pattern not in own:
            raise RigFileError(
                f"files: found none for {source.pattern!r} of the run {run!r}, beside "
                f"{next(iter(own.values()))}; expected one",
                USAGE,
            )
    return RunFiles(run, tuple((source, own[source.pattern]) for source in sources))


# --- what is used of a file ---


def parts(
    path: Path, source: MapSource, mapped: SeriesMap, advance: Advance | None = None
) -> list[SourcePart]:
    """The columns that a map names of a file, those of one clock together. Raises RigFileError."""
    tables = read(path, Wanted(frozenset(source.columns)), source.columns, advance)
    return parts_of(path, tables, source, mapped)


def parts_of(
    path: Path, tables: Sequence[SeriesTable], source: MapSource, mapped: SeriesMap
) -> list[SourcePart]:
    """The same of a file that was read. Raises RigFileError."""
    places = {name: _place(path, tables, name) for name in source.columns}

    alike: dict[tuple[int, tuple[str, ...], float | None], list[str]] = {}
    for name, (number, _) in places.items():
        if source.columns[name].channel not in CLOCKS:
            rate = source.columns[name].rate or source.rate
            times = tuple(_clock_of(tables, places, source, name, kind) for kind in CLOCKS)
            alike.setdefault((number, times, rate), []).append(name)

    if not alike:
        raise RigFileError(f"{path}: columns: found times alone; expected a channel", USAGE)
    return [
        _part(tables, places, source, mapped, names, [t for t in times if t], rate)
        for (_, times, rate), names in alike.items()
    ]


def _place(path: Path, tables: Sequence[SeriesTable], name: str) -> Place:
    """The table that a column is of, and its name there. Raises RigFileError."""
    for number, table in enumerate(tables):
        if name in table.columns:
            return number, name

    short = [
        (number, full)
        for number, table in enumerate(tables)
        for full in table.columns
        if table.short(full) == name
    ]
    if len(short) == 1:
        return short[0]
    if short:
        raise RigFileError(
            f"{path}: found {name!r} in several groups; expected one of "
            f"{listed([full for _, full in short])}",
            USAGE,
        )

    raise no_column(path, name, [full for table in read(path, SAMPLE) for full in table.columns])


def _clock_of(
    tables: Sequence[SeriesTable],
    places: Mapping[str, Place],
    source: MapSource,
    name: str,
    kind: str,
) -> str:
    """The time, or the date, of a column: of several in its table the one whose path is most its
    own, then the last before it. Without any, one of another group with as many rows; '' without.
    """
    number, full = places[name]
    order = list(tables[number].columns)
    clocks = [clock for clock in places if source.columns[clock].channel == kind]
    own = [clock for clock in clocks if places[clock][0] == number]
    if not own:
        same = [c for c in clocks if tables[places[c][0]].rows == tables[number].rows]
        return same[0] if len(same) == 1 and tables[number].clock is None else ""

    def nearness(clock: str) -> tuple[int, bool, int]:
        there = places[clock][1]
        path = common([full, there])
        ahead = order.index(full) - order.index(there)
        return len(path), ahead > 0, -abs(ahead)

    return max(own, key=nearness)


def _part(
    tables: Sequence[SeriesTable],
    places: Mapping[str, Place],
    source: MapSource,
    mapped: SeriesMap,
    names: Sequence[str],
    times: Sequence[str],
    rate: float | None,
) -> SourcePart:
    """Columns of one clock, and the map of them. Raises RigFileError."""
    table = tables[places[names[0]][0]]
    named = [*times, *names]
    columns = {source.label(n): tables[places[n][0]].columns[places[n][1]] for n in named}
    kinds = {source.label(name): source.columns[name] for name in named}
    _check_numbers(table, {source.label(name): columns[source.label(name)] for name in names})

    if table.clock is not None and not times:
        columns[OWN_CLOCK] = Column(np.full(table.rows, np.nan), instants=table.clock)
        kinds[OWN_CLOCK] = Mapped(TIME, CLOCK)
    elif not times and rate is None:
        where = f"{table.group}: " if table.group else ""
        raise RigFileError(
            f"{table.path}: {where}found no time for {names[0]!r}; expected a column of its group "
            "with channel: time, or the rate: of its rows",
            USAGE,
        )

    made = replace(table, columns=columns, group="", clock=None)
    clocked = len(tables) > 1 or table.clock is not None or len(columns) < len(places)
    if clocked and rate is None:  # a rate counts the empty rows too
        made = made.at(_filled([columns[source.label(name)] for name in names]))
    return SourcePart(made, replace(mapped, columns=kinds, rate=rate), source.shift)


def _filled(columns: Iterable[Column]) -> NDArray[np.bool_]:
    """Marks the rows (n,) in which any column has something."""
    some = [np.isfinite(c.numbers) if c.words is None else c.numbers != 0.0 for c in columns]
    return np.asarray(np.any(some, axis=0))


def _check_numbers(table: SeriesTable, columns: Mapping[str, Column]) -> None:
    """Raises RigFileError where a column holds what no log has: larger numbers, or none."""
    for label, column in columns.items():
        known = column.numbers[np.isfinite(column.numbers)]
        if np.any(np.abs(known) > LARGEST):
            raise RigFileError(f"{table.path}: {label}: expected numbers up to {LARGEST:g}")
