"""The map of `gritd import series`: which column is which channel, in which unit; strict YAML with
one line for a mistake.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gritd.estimator.config import units
from gritd.estimator.config.kinds import Choice, Integer, NumberWithUnit, Text
from gritd.estimator.config.schema import (
    ABSENT,
    NEEDED,
    Impossible,
    Key,
    Section,
    Variant,
    entries,
    uncertain,
)
from gritd.estimator.config.settings import Uncertain
from gritd.estimator.config.yamltree import Mapping as Tree
from gritd.estimator.config.yamltree import Node, compose, read_text
from gritd.estimator.messages.run_info import RunInfo
from gritd.tools.importers.series.times import ORDERS, TimeFormatError, clock

# channel of the map -> SI unit and meaning
MEASURED = {
    "wheel_angle": ("rad", "angle of the wheel"),
    "wheel_speed": ("rad/s", "speed of the wheel"),
    "rim_speed": ("m/s", "speed of the rim, rω"),
    "wheel_count": ("count", "counts of the wheel encoder, as the configuration scales them"),
    "carriage_position": ("m", "travel of the carriage"),
    "carriage_speed": ("m/s", "speed of the carriage"),
    "carriage_count": ("count", "counts of the carriage encoder, as the configuration scales them"),
    "sinkage": ("m", "sinkage z, positive downward"),
    "sinkage_volts": ("V", "volts of the potentiometer, as the configuration scales them"),
    "current": ("A", "motor current"),
    "shunt_volts": ("V", "volts of the motor shunt, as the configuration scales them"),
    "motor_torque": ("N*m", "torque at the axle as the motor's current tells it"),
    "torque": ("N*m", "torque at the axle, of a torque sensor"),
    "drawbar_pull": ("N", "drawbar pull, positive where the wheel pulls"),
    "load": ("N", "vertical load W as measured"),
    "lateral_force": ("N", "lateral force"),
    "motor_temperature": ("degC", "temperature of the winding"),
}
WRAPPING = ("wheel_angle", "wheel_count", "carriage_position", "carriage_count")
AS_CONFIGURED = ("wheel_count", "carriage_count", "sinkage_volts", "shunt_volts")
WHEEL_MOTION = {"wheel_angle", "wheel_speed", "rim_speed", "wheel_count"}
MOTOR_TORQUE = {"current", "motor_torque", "shunt_volts"}
OF_THE_BED = {
    *("carriage_position", "carriage_speed", "carriage_count"),
    *("sinkage", "sinkage_volts", "drawbar_pull"),
}
OF_THE_RUN = {
    "nominal_load": ("N", "weights of the run"),
    "start": ("m", "starting position on the bed"),
    "pass": ("", "number of the pass over the bed"),
}
DATE, TIME = "date", "time"  # the channels of columns that tell when a row was taken
CLOCK = "clock"  # the unit of a time that is written as a date or as a time of day
SPELLINGS = {
    "Nm": "N*m",
    "N.m": "N*m",
    "N-m": "N*m",
    "°": "deg",
    "°C": "degC",
    "sec": "s",
    "msec": "ms",
    "usec": "us",
    "nsec": "ns",
}


@dataclass(frozen=True)
class Mapped:
    """One column: physical = column · unit · factor + offset.

    noise: standard deviation of one reading, SI; None where it is to be estimated.
    order: of a date, one of ORDERS; '' where the file tells.
    epoch: day [ns since 1970] from which a number of time counts.
    rate: [Hz] of the column's rows, where it has no time; None where the map does not say.
    wraps: after which the column begins anew, SI; None where it does not.
    """

    channel: str
    unit: str = ""
    factor: Uncertain = field(default_factory=lambda: Uncertain(1.0))
    offset: Uncertain = field(default_factory=lambda: Uncertain(0.0))
    noise: float | None = None
    order: str = ""
    epoch: int = 0
    rate: float | None = None
    wraps: float | None = None

    @property
    def per_unit(self) -> float:
        """SI value of one of the column's unit."""
        return float(units.unit(self.unit).factor)


@dataclass(frozen=True)
class MapSource:
    """The files that a pattern names, and what is used of them.

    pattern: of a file's name; a `*` stands for the name of the run. '' for every file.
    columns: by the file's names for them. labels: what SeriesMap.columns calls each.
    rate: [Hz] of the rows, where there is no column of time.
    shift: [s] is added to the times.
    """

    pattern: str
    columns: Mapping[str, Mapped]
    rate: float | None = None
    shift: float = 0.0

    def label(self, name: str) -> str:
        """What SeriesMap.columns calls a column: by its file where there are several."""
        return f"{self.pattern}: {name}" if self.pattern else name


@dataclass(frozen=True)
class SeriesMap:
    """What a map says; the columns by name, of all sources."""

    columns: Mapping[str, Mapped]
    sources: tuple[MapSource, ...]
    runs: Mapping[str, RunInfo]
    rate: float | None  # [Hz] of the rows; a column of time then tells only when they begin
    resample: float | None  # [Hz] of the readings, where not every row is to be one
    radius: float | None  # [m]
    width: float | None  # [m]
    torque_constant: Uncertain | None  # [N·m/A]
    load: float | None  # [N] of every run that states no other
    operator: str = ""  # of every run that states no other
    notes: str = ""  # the same

    @property
    def drive_alone(self) -> bool:
        """Whether there is a motor with its angle, and neither carriage nor sinkage: a wheel that
        is lifted, or none.
        """
        there = {mapped.channel for mapped in self.columns.values()}
        turned = bool(there & WHEEL_MOTION and there & MOTOR_TORQUE)
        return turned and not there & OF_THE_BED

    def named(self, channel: str) -> str | None:
        """The column of a channel."""
        return next((n for n, mapped in self.columns.items() if mapped.channel == channel), None)


@dataclass(frozen=True)
class UnitOf:
    """The name of a unit of the same kind as `si`; CLOCK for a time too."""

    si: str

    @property
    def expected(self) -> str:
        clock = f", or {CLOCK} for dates and times of day" if self.si == "s" else ""
        return f"a unit of the same kind as {self.si or 'a plain number'}{clock}"

    def read(self, node: Node) -> tuple[str, Node]:
        text, _ = Text("a unit").read(node)
        if self.si == "s" and text == CLOCK:
            return text, node
        try:
            unit = spelled(text)
            if units.unit(unit).dimension == units.unit(self.si).dimension:
                return unit, node
            raise node.place.error(text, self.expected)
        except units.UnitError as error:
            raise node.place.error(str(error), self.expected) from None


def spelled(text: str) -> str:
    """A unit as gritd writes it: `Nm` is N*m."""
    return SPELLINGS.get(text, text)


@dataclass(frozen=True)
class ColumnMapping:
    """A mapping of columns, by any names."""

    expected: str = "a mapping of columns"

    def read(self, node: Node) -> tuple[dict[str, Mapped], Node]:
        kind = Variant("channel", _channels())
        given = entries(node, self.expected)
        read = {name: kind.read(item)[0] for name, item in given.items()}

        check_once([(name, mapped, given[name]) for name, mapped in read.items()])
        return read, Tree(node.place, dict(given))


def check_once(columns: Iterable[tuple[str, Mapped, Node]]) -> None:
    """Every channel has one column; each table may have a time of its own. Raises ConfigError."""
    seen: dict[str, str] = {}
    for name, mapped, node in columns:
        if mapped.channel in seen and mapped.channel not in (DATE, TIME):
            raise node.place.error(
                f"{mapped.channel} again, which is {seen[mapped.channel]} already",
                "each channel once",
            )
        seen[mapped.channel] = name


@dataclass(frozen=True)
class Files:
    """Several files of each run, each with a clock of its own, by a pattern of their names."""

    expected: str = "a mapping of files"

    def read(self, node: Node) -> tuple[tuple[MapSource, ...], Node]:
        kind = Section(OF_FILE, dict)
        given = entries(node, self.expected)
        made = {pattern: kind.read(item)[0] for pattern, item in given.items()}
        check_once(
            [
                (name, mapped, given[pattern])
                for pattern, values in made.items()
                for name, mapped in values["columns"].items()
            ]
        )
        return tuple(MapSource(pattern, **values) for pattern, values in made.items()), node


@dataclass(frozen=True)
class RunTable:
    """What is said of each run, by its file's name or by what the column of runs holds."""

    expected: str = "a mapping of runs"

    def read(self, node: Node) -> tuple[dict[str, RunInfo], Node]:
        kind = Section(RUN, _run)
        given = entries(node, self.expected)
        return {name: kind.read(item)[0] for name, item in given.items()}, node


RUN = {
    "load": Key(NumberWithUnit("N", above=0), "weights", ABSENT),
    "pass": Key(Integer(1, 1000), "number of the pass", "1"),
    "start": Key(NumberWithUnit("m"), "starting position", "0 m"),
    "operator": Key(Text(), "who ran it", "''"),
    "notes": Key(Text(), "one line", "''"),
}
WHEEL = {
    "radius": Key(NumberWithUnit("m", above=0, high=5), "wheel radius r"),
    "width": Key(NumberWithUnit("m", above=0, high=5), "wheel width b"),
}


OF_FILE = {
    "columns": Key(ColumnMapping(), "the columns that are used"),
    "rate": Key(NumberWithUnit("Hz", above=0), "of the rows, where no time tells it", ABSENT),
    "shift": Key(NumberWithUnit("s"), "is added to the times", "0 s"),
}


def _run(load: float | None, start: float, **values: Any) -> RunInfo:
    stated = {name: values[name] for name in ("operator", "notes")}
    return RunInfo("", load, values["pass"], start, **stated)


def _channels() -> dict[str, Section]:
    """The keys of a column, by its channel."""
    plain = {name: _plain(name, si) for name, (si, _) in OF_THE_RUN.items()}
    measured = {
        name: _plain(name, si) if name in AS_CONFIGURED else _measured(name, si)
        for name, (si, _) in MEASURED.items()
    }
    for name in WRAPPING:
        wraps = Key(
            NumberWithUnit(MEASURED[name][0], above=0), "after which it begins anew", ABSENT
        )
        measured[name] = Section(dict(measured[name].keys) | {"wraps": wraps}, _mapped)
    run = Section(_choice("run"), Mapped)
    order = Key(Choice(ORDERS), "of a date in numbers", ABSENT)
    time = {"order": order, "epoch": Key(Text("a date"), "day that numbers count from", ABSENT)}
    return {
        TIME: Section(_choice(TIME) | {"unit": Key(UnitOf("s"), "of the column")} | time, _time),
        DATE: Section(_choice(DATE) | {"order": order}, _time),
        "run": run,
        **plain,
        **measured,
    }


def _choice(channel: str) -> dict[str, Key]:
    return {"channel": Key(Choice((channel,)), "what the column holds")}


def _plain(name: str, si: str) -> Section:
    unit = Key(UnitOf(si), "unit of the column", NEEDED if si else ABSENT)
    return Section(_choice(name) | {"unit": unit}, _mapped)


def _measured(name: str, si: str) -> Section:
    difference = "K" if si == "degC" else si
    keys = {
        "unit": Key(UnitOf(si), "unit of the column"),
        "factor": Key(uncertain(""), "multiplies the column; -1 turns its sign", "1.0"),
        "offset": Key(uncertain(difference), "is added", f"0 {difference}"),
        "noise": Key(NumberWithUnit(difference, above=0), "of one reading; else estimated", ABSENT),
        "rate": Key(NumberWithUnit("Hz", above=0), "of its rows, where they have no time", ABSENT),
    }
    return Section(_choice(name) | keys, _mapped)


def _time(order: str | None = None, epoch: str | None = None, **values: Any) -> Mapped:
    try:
        day = int(clock([epoch]).read([epoch])[0]) if epoch else 0
    except TimeFormatError as error:
        raise Impossible("epoch", f"a day such as 1904-01-01 ({error})", epoch or "") from None
    return Mapped(**{"unit": CLOCK} | values, order=order or "", epoch=day)


def _mapped(unit: str | None = None, **values: Any) -> Mapped:
    if "factor" in values and values["factor"].value == 0.0:
        raise Impossible("factor", "a factor other than 0", "0")
    return Mapped(unit=unit or "", **values)


def _whole(
    wheel: dict[str, float] | None,
    columns: dict[str, Mapped] | None,
    files: tuple[MapSource, ...] | None,
    rate: float | None,
    **values: Any,
) -> SeriesMap:
    if not columns and not files:
        raise Impossible("columns", "the columns that are used; or files:, each with its columns")
    if columns and files:
        raise Impossible("files", "either columns: or files:, each of which has columns")

    sources = files or (MapSource("", columns or {}, rate),)
    labelled = {s.label(name): mapped for s in sources for name, mapped in s.columns.items()}
    known = wheel or {}
    return SeriesMap(
        labelled, sources, rate=rate, radius=known.get("radius"), width=known.get("width"), **values
    )


TABLE = Section(
    {
        "columns": Key(ColumnMapping(), "the columns that are used", ABSENT),
        "rate": OF_FILE["rate"],
        "files": Key(Files(), "several files of each run, with their columns", ABSENT),
        "resample": Key(NumberWithUnit("Hz", above=0), "means over as many rows", ABSENT),
        "wheel": Key(Section(WHEEL, dict), "the wheel, without --config", ABSENT),
        "torque_constant": Key(uncertain("N*m/A", above=0), "of the drive", ABSENT),
        "load": Key(NumberWithUnit("N", above=0), "weights of every run", ABSENT),
        "operator": Key(Text(), "who made the runs", "''"),
        "notes": Key(Text(), "of every run that has none of its own", "''"),
        "runs": Key(RunTable(), "what is known of each run", "{}"),
    },
    _whole,
)


def load(path: Path) -> SeriesMap:
    """Read a map. Raises ConfigError."""
    return loads(read_text(path, "a map of columns"), str(path))


def loads(text: str, name: str) -> SeriesMap:
    """Read the text of a map; `name` stands in messages. Raises ConfigError."""
    made: SeriesMap = TABLE.read(compose(text, name))[0]
    return made
