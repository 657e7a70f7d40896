"""Logs of a bevameter: a map says which column is the force on the plate, or the pressure under
it, which the depth, and how wide the plate is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gritd.estimator.config.kinds import Choice, NumberWithUnit
from gritd.estimator.config.schema import (
    ABSENT,
    Impossible,
    Key,
    Section,
    Variant,
    entries,
    uncertain,
)
from gritd.estimator.config.yamltree import Node, compose, read_text
from gritd.tools.cli.command import USAGE
from gritd.tools.importers.files import Array, RigFileError
from gritd.tools.importers.series.columns import SeriesTable, Wanted
from gritd.tools.importers.series.mapping import Mapped, UnitOf
from gritd.tools.importers.series.sources import read

# channel of the map -> SI unit and meaning
MEASURED = {
    "load": ("N", "force on the plate"),
    "pressure": ("Pa", "pressure under the plate, in the place of the force"),
    "sinkage": ("m", "depth of the plate, positive downward"),
}
DIAMETER = NumberWithUnit("m", above=0, high=2)


@dataclass(frozen=True)
class PlateMap:
    """What a map says: columns by name, diameters [m] of the plate by file; `diameter` of all
    others.
    """

    columns: Mapping[str, Mapped]
    plates: Mapping[str, float]
    diameter: float | None

    def named(self, channel: str) -> str | None:
        """The column of a channel."""
        return next((n for n, mapped in self.columns.items() if mapped.channel == channel), None)


@dataclass(frozen=True)
class PlateLog:
    """One log in the file's order: radius of the plate [m], force [N] and depth [m], each (n,)."""

    radius: float
    force: Array
    depth: Array


@dataclass(frozen=True)
class _Columns:
    expected: str = "a mapping of columns"

    def read(self, node: Node) -> tuple[dict[str, Mapped], Node]:
        kind = Variant("channel", {name: _column(name, si) for name, (si, _) in MEASURED.items()})
        given = entries(node, self.expected)
        return {name: kind.read(item)[0] for name, item in given.items()}, node


@dataclass(frozen=True)
class _Plates:
    expected: str = "a mapping of files to diameters"

    def read(self, node: Node) -> tuple[dict[str, float], Node]:
        given = entries(node, self.expected)
        return {name: DIAMETER.read(item)[0] for name, item in given.items()}, node


def _column(name: str, si: str) -> Section:
    keys = {
        "channel": Key(Choice((name,)), "what the column holds"),
        "unit": Key(UnitOf(si), "unit of the column"),
        "factor": Key(uncertain(""), "multiplies the column; -1 turns its sign", "1.0"),
        "offset": Key(uncertain(si), "is added", f"0 {si}"),
    }
    return Section(keys, Mapped)


def _whole(columns: dict[str, Mapped], plate: float | None, plates: dict[str, float]) -> PlateMap:
    made = PlateMap(columns, plates, plate)
    for either in (("load", "pressure"), ("sinkage",)):
        named = [channel for channel in either if made.named(channel) is not None]
        if len(named) != 1 or len(columns) != 2:
            raise Impossible(
                "columns",
                f"one column with channel: {' or '.join(either)}",
                ", ".join(c.channel for c in columns.values()),
            )
    return made


TABLE = Section(
    {
        "columns": Key(_Columns(), "force or pressure, and depth"),
        "plate": Key(DIAMETER, "diameter of the plate of every file that states no other", ABSENT),
        "plates": Key(_Plates(), "diameters by the names of files", "{}"),
    },
    _whole,
)


def load(path: Path) -> PlateMap:
    """Read a map. Raises ConfigError."""
    made: PlateMap = TABLE.read(compose(read_text(path, "a map of columns"), str(path)))[0]
    return made


def plate_log(path: Path, mapped: PlateMap, diameter: float | None = None) -> PlateLog:
    """One log of a file of any kind that `gritd import series` reads. diameter: [m] of the plate
    where the map states none. Raises RigFileError.
    """
    wide = mapped.plates.get(path.name, mapped.diameter) or diameter
    if wide is None:
        raise RigFileError(
            f"{path}: found no diameter of its plate; expected plate: or plates: in the map, or "
            "--plate",
            USAGE,
        )

    tables = read(path, Wanted(frozenset(mapped.columns)), mapped.columns)
    table = next((t for t in tables if set(mapped.columns) <= _names(t).keys()), tables[0])
    si = {m.channel: _numbers(table, name, m) for name, m in mapped.columns.items()}
    depth = si["sinkage"]
    force = si["load"] if "load" in si else si["pressure"] * np.pi * wide**2 / 4.0
    known = np.isfinite(force) & np.isfinite(depth)
    return PlateLog(wide / 2.0, force[known], depth[known])


def _names(table: SeriesTable) -> dict[str, str]:
    """Names of a table's columns, also without that of their group -> the whole names."""
    return {table.short(name): name for name in table.columns} | {n: n for n in table.columns}


def _numbers(table: SeriesTable, name: str, mapped: Mapped) -> Array:
    """A column in SI. Raises RigFileError."""
    numbers = table.column(_names(table).get(name, name)).numbers
    made: Array = numbers * mapped.per_unit * mapped.factor.value + mapped.offset.value
    return made
