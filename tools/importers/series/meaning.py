"""Which channel the name and the unit of a column speak of."""

from __future__ import annotations

import re
from dataclasses import dataclass

from gritd.estimator.config import units
from gritd.tools.importers.series import names
from gritd.tools.importers.series.columns import SeriesTable
from gritd.tools.importers.series.encoders import CHANNELS
from gritd.tools.importers.series.mapping import MEASURED

SI = {name: si for name, (si, _) in MEASURED.items()} | {"time": "s", "nominal_load": "N"}
RATE = re.compile(r"[_ .]([A-Za-zµ°]+)(?:_per_|_p_|_|p)s(?:ec)?$")  # speed_mm_s, omega_rad_per_s
ENDING = re.compile(r"[_ .,]+([^\s_,.]*[A-Za-zµμ°%][^\s_,]*)$")
OF_TOPICS = re.compile(r"\bstate\b")  # says nothing of what a topic holds
WHOSE = {"wheel", "carriage", "motor", "axle"}
MOTION = {channel for channels in CHANNELS.values() for channel in channels}
MESSAGE = re.compile(r"\.(data|value)$")  # of a ROS message that has nothing else
SIDE = "on which side of the drive it was measured"
CAPITAL = {"T": "torque?", "M": "torque?", "W": "load", "N": "load", "DP": "drawbar_pull"}
HEIGHT = (
    "whether it tells the sinkage; a height that falls: factor: -1, offset: that of the surface"
)
FORCE = "load"
JOINT = {"joint", "joints"}
AXLE, OTHER_AXES = {"ty", "my", "y"}, {"tx", "mx", "tz", "mz", "x", "z"}


@dataclass(frozen=True)
class ColumnUnit:
    """As gritd writes it, and what the column is multiplied by for it."""

    name: str
    factor: float = 1.0


@dataclass(frozen=True)
class Meaning:
    """What a column may hold.

    channel: of the map; "torque?" where the side is not stated.
    sure: how clearly the name says so; of two columns the surer is taken.
    asks: what the user has to decide, or nothing.
    """

    channel: str
    sure: int = 2
    asks: str = ""


def unit_of(table: SeriesTable, name: str) -> ColumnUnit | None:
    """Of the row of units, in brackets, or at the end of the name; None where nothing is stated."""
    plain = MESSAGE.sub("", name)
    rate, ending = RATE.search(plain), ENDING.search(plain)
    texts = (
        (table.units or {}).get(name, ""),
        *reversed(names.IN_BRACKETS.findall(name)),
        f"{rate[1]}/s" if rate else "",
        ending[1] if ending and ending[1] != "v" else "",  # data.v is no volt
        name if len(name) > 1 or name.isupper() else "",
    )
    for text in texts:
        if text and (known := names.unit_of(text)) is not None:
            return ColumnUnit(*known)
    return None


def fits(channel: str, unit: ColumnUnit | None) -> bool:
    """Whether a unit is one of a channel; none is of every one."""
    if unit is None:
        return True
    wanted = SI.get(FORCE if channel == "force?" else channel.rstrip("?"))
    return wanted is not None and units.unit(unit.name).dimension == units.unit(wanted).dimension


def meaning_of(name: str, unit: ColumnUnit | None) -> Meaning | None:
    """The channel that a name speaks of, with a unit of its kind."""
    plain = names.IN_BRACKETS.sub(_kept, name).strip()
    if plain in CAPITAL and fits(CAPITAL[plain], unit):
        return Meaning(CAPITAL[plain], 1, SIDE if CAPITAL[plain] == "torque?" else "")

    plain = OF_TOPICS.sub(" ", plain) if plain.startswith("/") else plain
    means, words = names.meanings(plain), set(names.words_of(plain))
    if "other" in means or means == {"number"}:
        return None

    for found in (_time, _drive, _force, _motion, _by_unit):
        meaning = found(means, words, unit)
        if meaning is not None and fits(meaning.channel, unit):
            return meaning
    return None


def meaning_in(table: SeriesTable, name: str, unit: ColumnUnit | None) -> Meaning | None:
    """Of a column's name without its group, else with it; with it, where that alone says whose
    motion it is.
    """
    found, short = meaning_of(table.short(name), unit), table.short(name)
    if short == name:
        return found
    whole = meaning_of(name, unit)
    whose = names.meanings(name) & WHOSE and not names.meanings(short) & WHOSE
    if found is None or (found.channel in MOTION and whose):
        return whole or found
    return found


def _kept(bracket: re.Match[str]) -> str:
    """What stands in brackets belongs to the name, unless it is a unit."""
    return " " if names.unit_of(bracket[1]) else f" {bracket[1]} "


def _time(means: set[str], words: set[str], unit: ColumnUnit | None) -> Meaning | None:
    if "time" in means:
        return Meaning("time") if means <= {"time", "number", "date"} else Meaning("time", 1)
    if "date" in means:
        return Meaning("date")
    if "run" in means and unit is None:
        return Meaning("run")
    return Meaning("motor_temperature") if "temperature" in means else None


def _force(means: set[str], words: set[str], unit: ColumnUnit | None) -> Meaning | None:
    """Pull, load, lateral force; by the axis of a force, too."""
    if "torque" in means:
        return None
    for meaning, channel in (
        ("pull", "drawbar_pull"),
        ("lateral", "lateral_force"),
        ("load", "load"),
    ):
        if meaning in means and fits(channel, unit):
            return Meaning(channel, 1 if words == {"w"} else 2)

    if "force" not in means or not fits(FORCE, unit):
        return None
    for axis, channel in names.AXES.items():
        if axis in words:
            return Meaning(channel, 1)
    return Meaning("force?", 0, "which force it is") if "effort" not in means else None


def _drive(means: set[str], words: set[str], unit: ColumnUnit | None) -> Meaning | None:
    """Torque and current."""
    if "torque" in means and fits("torque", unit):
        sure = 1 if words & OTHER_AXES else 2
        if "motor" in means:
            return Meaning("motor_torque", sure)
        if means & {"axle", "wheel"}:
            which = "whether it is the axis of the axle" if words & (AXLE | OTHER_AXES) else ""
            return Meaning("torque", sure, which)
        return Meaning("torque?", sure, SIDE)

    if "effort" in means and unit is None and means & {"wheel", "motor", "axle"}:
        return Meaning("torque?", 1, f"whether it is a torque, and {SIDE}")
    if "current" in means and fits("current", unit):
        return Meaning("current", 1 if words == {"i"} else 2)
    return None


def _motion(means: set[str], words: set[str], unit: ColumnUnit | None) -> Meaning | None:
    """Sinkage; wheel and carriage as speed, angle, position or counts."""
    rate = unit is not None and any(fits(c, unit) for c in ("wheel_speed", "carriage_speed"))
    speed = bool(means & {"speed", "turning"}) or rate or bool(words & {"v", "vx"})
    if "sinkage" in means and not speed:
        return Meaning("sinkage", 1 if words == {"z"} else 2)
    if "height" in means and not speed and fits("sinkage", unit):
        return Meaning("sinkage", 0, HEIGHT)

    counts = "counts" in means if unit is None else unit.name == "count"
    if "wheel" in means:
        return _wheel(speed, counts, unit)
    if "carriage" in means:
        kind = "count" if counts else "speed" if speed else "position"
        return Meaning(f"carriage_{kind}", 2, _of_counts("carriage", counts))
    return _unnamed(means, words, speed, counts and "counts" in means, unit)


def _wheel(speed: bool, counts: bool, unit: ColumnUnit | None) -> Meaning | None:
    if counts:
        return Meaning("wheel_count", 2, _of_counts("wheel", counts))
    if unit is not None and fits("rim_speed", unit):
        return Meaning("rim_speed")
    return Meaning("wheel_speed" if speed else "wheel_angle")


def _of_counts(what: str, counts: bool) -> str:
    other = {"wheel": "wheel_angle, unit: rad", "carriage": "carriage_position, unit: m"}[what]
    return (
        f"what one count is: --config states it, or channel: {other}, factor: of one count"
        if counts
        else ""
    )


def _unnamed(
    means: set[str], words: set[str], speed: bool, counts: bool, unit: ColumnUnit | None
) -> Meaning | None:
    """Motion of which the name does not say whose."""
    turning = "turning" in means or (unit is not None and fits("wheel_speed", unit))
    if "motor" in means and "axle" not in means and (turning or speed):
        return Meaning("wheel_speed", 0, "the motor's: factor: 1 over the ratio of the gear")
    if turning:
        return Meaning("wheel_speed", 1)
    if counts:
        return Meaning("wheel_count", 0, _of_counts("wheel", counts))
    if words & JOINT and (unit is None or fits("wheel_angle", unit)) and "position" in means:
        return Meaning("wheel_angle", 0, "whether this joint turns the wheel")
    if words & JOINT and speed and unit is None:
        return Meaning("wheel_speed", 0, "whether this joint turns the wheel")
    if "angle" in means and not speed:
        return Meaning("wheel_angle", 1)
    if speed:
        whose = (
            "whether it is the carriage's" if "speed" not in means and words & {"v", "vx"} else ""
        )
        return Meaning("carriage_speed", 1, whose)
    if "position" in means or "x" in words:
        return Meaning("carriage_position", 1)
    return None


def _by_unit(means: set[str], words: set[str], unit: ColumnUnit | None) -> Meaning | None:
    """Where the name says nothing that is known, and the unit is of one channel alone."""
    if unit is None or means - {"motor", "axle"}:
        return None
    if fits("torque", unit):
        channel = "motor_torque" if "motor" in means else "torque" if means else "torque?"
        return Meaning(channel, 0, "" if means else SIDE)
    if fits("current", unit):
        return Meaning("current", 0)
    return Meaning("wheel_speed", 0) if fits("wheel_speed", unit) else None
