"""A proposal for a map, from the names of the columns and from what they hold."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gritd.estimator.config import units
from gritd.tools.importers.files import Array
from gritd.tools.importers.series.columns import Column, SeriesTable
from gritd.tools.importers.series.mapping import MEASURED, spelled

SI = {name: si for name, (si, _) in MEASURED.items()} | {"time": "s", "nominal_load": "N"}
SPEED = {"speed", "velocity", "vel", "rate", "omega", "rpm", "v", "vx", "w"}
WHEEL = {"wheel", "rim", "rotor", "drum", "omega", "rpm"}
CARRIAGE = {"carriage", "cart", "trolley", "travel", "rail", "linear", "body", "gantry", "forward"}
# channel -> words of which one stands in the name
WORDS = {
    "time": {"time", "t", "timestamp", "clock", "seconds", "sec", "elapsed", "date", "datetime"},
    "run": {"run", "trial", "test", "experiment", "case"},
    "motor_temperature": {"temperature", "temp", "celsius"},
    "sinkage": {"sinkage", "sink", "z", "depth", "penetration"},
    "drawbar_pull": {"drawbar", "dp", "pull", "fx", "thrust", "traction"},
    "lateral_force": {"lateral", "fy", "side"},
    "load": {"load", "fz", "fn", "normal", "vertical", "weight"},
    "current": {"current", "amps", "ampere", "i"},
    "torque": {"torque", "moment", "ty", "my", "mz", "tz"},
}
RATE = re.compile(r"[_ .]([A-Za-zµ°]+)(?:_per_|_p_|_|p)s(?:ec)?$")  # speed_mm_s, omega_rad_per_s
BY_UNIT = {"N*m": "torque", "A": "current", "rpm": "wheel_speed", "rad/s": "wheel_speed"}
HEAD = """\
# A proposal of `gritd import csv --guess`: check every line, then import with --map.
# Channels: docs/importing.md. factor: -1 turns a sign; noise is estimated where it is not stated.
"""
WHEEL_LINES = """\
# Without --config the wheel has to be stated here:
# wheel: {radius: 72 mm, width: 71 mm}
"""


@dataclass(frozen=True)
class Guess:
    """What a column may be, and why."""

    channel: str
    unit: str
    why: str
    factor: str = ""

    def line(self, name: str) -> str:
        """As a line of the map."""
        unit = f", unit: {self.unit}" if self.unit else ""
        return f"  {_quoted(name)}: {{channel: {self.channel}{unit}{self.factor}}} # {self.why}"


def guessed(tables: Sequence[SeriesTable]) -> str:
    """YAML text of a map for files with the columns of the first; a file may hold several tables,
    each with a clock of its own.
    """
    first = [table for table in tables if table.path == tables[0].path]
    taken: set[str] = set()
    lines = [HEAD + "columns:"]
    for table in first:
        taken.discard("time")
        for name, column in table.columns.items():
            guess = _guess(table, name, column, several=len(tables) > len(first))
            if guess is None or guess.channel in taken:
                lines.append(f"  # {_quoted(name)}: not used, {_range(column)}")
                continue
            taken.add(guess.channel)
            lines.append(guess.line(name))

    timeless = "time" not in taken and any(table.clock is None for table in first)
    lines += ["", "rate: 100 Hz # of the rows: no column of time was found"] * timeless
    lines += ["", WHEEL_LINES + "# torque_constant: {value: 2.0 N*m/A, sigma: 0.02 N*m/A}"]
    if not taken & {"load", "nominal_load"}:
        lines += ["", "# load: 70 N # weights of every run; or for each:"]
    names = dict.fromkeys(table.path.name for table in tables)
    lines += ["# runs:", *(f"#   {_quoted(name)}: {{load: 70 N, pass: 1}}" for name in names)]
    return "\n".join(lines) + "\n"


def _guess(table: SeriesTable, name: str, column: Column, several: bool) -> Guess | None:
    words, unit = _words(table.short(name)), _unit(table, name)
    channel = _channel(words, unit)
    if channel is None:
        return None
    if column.words is not None:
        return _of_words(channel, column)

    known = column.numbers[np.isfinite(column.numbers)]
    constant = known.size > 0 and np.ptp(known) == 0.0
    if channel == "run":
        return None if several and constant else Guess("run", "", "one run for each value")
    if constant and channel == "load":
        return Guess("nominal_load", unit or "N", f"the same throughout, {known[0]:g}")
    if constant or not known.size:
        return None

    why = "unit of the file" if unit else "unit guessed from the values"
    unit = unit or _likely_unit(channel, known)
    if _is_turned(channel, known):
        return Guess(channel, unit, f"{why}; mostly negative, so turned", ", factor: -1")
    return Guess(channel, unit, f"{why}, {_range(column)}")


def _is_turned(channel: str, known: Array) -> bool:
    """Whether a channel that is positive in usual driving has the other sign."""
    if channel in ("time", "motor_temperature", "drawbar_pull", "lateral_force"):
        return False
    if channel in ("wheel_angle", "wheel_count", "carriage_position", "carriage_count"):
        return bool(known[-1] < known[0])
    return float(np.median(known)) < 0.0


def _of_words(channel: str, column: Column) -> Guess | None:
    assert column.words is not None
    if channel == "time":
        return Guess("time", "clock", f"written as {column.words[0][:30]}")
    return Guess("run", "", "one run for each value") if channel == "run" else None


def _channel(words: set[str], unit: str) -> str | None:
    """The channel that name and unit speak of."""
    moving = _moving(words, unit)
    if moving is not None:
        return moving
    for channel, options in WORDS.items():
        if words & options and _fits(channel, unit):
            return channel
    return BY_UNIT.get(unit)


def _moving(words: set[str], unit: str) -> str | None:
    """Of wheel and carriage: as speed, angle, position or counts."""
    speed = bool(words & SPEED) or unit.endswith("/s") or unit == "rpm"
    count = bool(words & {"count", "counts", "ticks", "encoder", "enc"}) and not unit
    if words & {"torque", "current", "force", "load", "temperature", "slip", "sinkage"}:
        return None

    if words & WHEEL:
        rim = "rim_speed" if unit and _fits("rim_speed", unit) else "wheel_speed"
        return "wheel_count" if count else rim if speed else "wheel_angle"
    if words & CARRIAGE or words & {"x", "position", "distance", "displacement", "vx"}:
        position = "carriage_speed" if speed else "carriage_position"
        return "carriage_count" if count else position
    return None


def _fits(channel: str, unit: str) -> bool:
    """Whether a unit is one of a channel; no unit is."""
    if not unit or channel == "run":
        return not unit or channel != "run"
    try:
        return units.unit(unit).dimension == units.unit(SI[channel]).dimension
    except units.UnitError:
        return False


def _words(name: str) -> set[str]:
    """The words of a column's name: `wheelSpeed_rpm` has three."""
    parted = re.sub(r"([a-z])([A-Z])", r"\1 \2", name)
    return {word for word in re.split(r"[^A-Za-zω]+", parted.lower()) if word}


def _unit(table: SeriesTable, name: str) -> str:
    """The unit of a column: of the row of units, in brackets, or at the end of its name."""
    told = (table.units or {}).get(name, "")
    bracket = re.search(r"[\[(]([^\])]+)[\])]\s*$", name)
    ending = re.search(r"[_ .]([A-Za-zµ°%]+)$", name)
    rate = RATE.search(name)

    options = (
        told,
        bracket[1] if bracket else "",
        f"{rate[1]}/s" if rate else "",
        ending[1] if ending else "",
    )

    for text in options:
        for way in (text, _usual_case(text)):
            try:
                if way and units.unit(spelled(way)).dimension:
                    return spelled(way)
            except units.UnitError:
                continue
    return ""


def _usual_case(text: str) -> str:
    """`n` for N, `nm` for N*m: names are often written small."""
    return {"n": "N", "nm": "N*m", "a": "A", "ma": "mA", "kn": "kN", "mps": "m/s"}.get(text, "")


def _likely_unit(channel: str, known: Array) -> str:
    """A unit in which the values are of a usual size."""
    if channel == "time":
        step = float(np.median(np.abs(np.diff(known)))) if known.size > 1 else 0.0
        return "ms" if step >= 1.0 else "s"

    large = float(np.max(np.abs(known)))
    smaller = {"sinkage": ("mm", 0.5), "carriage_position": ("mm", 20.0), "current": ("mA", 100.0)}
    faster = {"carriage_speed": ("mm/s", 1.0), "wheel_angle": ("deg", 200.0)}
    unit, limit = (smaller | faster).get(channel, ("", np.inf))
    return unit if large > limit else SI[channel]


def _range(column: Column) -> str:
    """The values of a column in words."""
    known = column.numbers[np.isfinite(column.numbers)]
    return f"{known.min():.4g} to {known.max():.4g}" if known.size else "no numbers"


def _quoted(name: str) -> str:
    """A column's name as a key of YAML."""
    if re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name) and name.lower() not in (
        "yes",
        "no",
        "y",
        "n",
    ):
        return name
    return "'" + name.replace("'", "''") + "'"
