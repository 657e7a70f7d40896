"""What a map may say of one column: a line, or lines of which the user has to choose one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.config import units
from gritd.estimator.config.names import is_file_name
from gritd.estimator.plausibility.clock import wrap_of
from gritd.tools.importers.files import LARGEST, Array
from gritd.tools.importers.series.columns import Column, SeriesTable
from gritd.tools.importers.series.encoders import SPEEDS
from gritd.tools.importers.series.mapping import CLOCK, DATE, MEASURED, TIME, Mapped
from gritd.tools.importers.series.meaning import SI, ColumnUnit, Meaning, meaning_in, unit_of
from gritd.tools.importers.series.names import meanings
from gritd.tools.importers.series.stamps import TimeColumn
from gritd.tools.importers.series.times import ORDERS, TimeFormatError, likely_unit

OFTEN = (2e-4, 1.0)  # [s] between the rows of a log: the unit of time that gives this is likely
DAYS = (30_000.0, 80_000.0)  # what numbers of days of a spreadsheet lie between from 1982 on
DATENUM = (690_000.0, 770_000.0)  # MATLAB's, from 1889 to 2108: no unit of a map counts from there
EVEN = 0.05  # share of its usual step by which an even column's steps may differ
FORCES = ("drawbar_pull", "load", "lateral_force")
SIDES = {
    "torque": "at the axle, by a torque sensor",
    "motor_torque": "at the motor: what the drive loses is in it",
}
SIGNED = {
    "load": "a load presses down",
    "sinkage": "sinkage counts downward",
    "torque": "a torque that drives is positive",
    "motor_torque": "a torque that drives is positive",
    "current": "a current that drives is positive",
    "drawbar_pull": "a pull is positive where the wheel pulls",
}
COUNTS = ("wheel_count", "carriage_count")
NEAR = 0.02  # share of a turn, or of a counter's width, that the last reading before it may lack
STEADY = 0.01  # noise of an imposed speed that a file of binary numbers does not tell, of its size


@dataclass(frozen=True)
class Option:
    """One way to write the line of a column: what stands in its braces, and why."""

    text: str
    why: str


@dataclass(frozen=True)
class Proposal:
    """A column, its channel, and the line or lines for it.

    options: one, or several of which the user has to choose. asks: what about, or nothing.
    """

    name: str
    channel: str
    sure: int
    options: tuple[Option, ...]
    asks: str = ""


def proposal(tables: Sequence[SeriesTable], name: str) -> Proposal | None:
    """For a column of the first table; the others are those of the other files."""
    table = tables[0]
    unit = unit_of(table, name)
    meaning = meaning_in(table, name, unit)
    if meaning is None:
        return None
    if meaning.channel in (TIME, DATE):
        return _of_time(name, table.columns[name], meaning, unit)

    columns = [t.columns[name] for t in tables]
    if meaning.channel == "run":
        return _of_runs(name, columns)
    if any(column.words is not None for column in columns):
        return None
    return _measured(name, columns, meaning, unit)


def even(table: SeriesTable) -> Proposal | None:
    """A column without a known name that rises evenly, as a time does and a row's number."""
    for name, column in table.columns.items():
        known = column.numbers
        if column.words is not None or known.size < 3 or not known[-1] > known[0]:
            continue
        unit = unit_of(table, name)
        if (
            not np.isfinite(known).all()
            or meanings(name)
            or (unit is not None and unit.name not in ("s", "ms", "us", "ns"))
        ):
            continue
        steps = np.diff(known)
        usual = float(np.median(steps))
        if usual <= 0.0 or np.ptp(steps) > max(EVEN * usual, 2.5 * column.resolution):
            continue
        if usual == 1.0 and known[0] in (0.0, 1.0):  # a row's number
            continue
        made = _of_time(name, column, Meaning(TIME, 0), unit)
        if made is not None:
            return replace(made, asks=made.asks or "it rises evenly, as a time does")
    return None


# --- time and runs ---


def _of_time(
    name: str, column: Column, meaning: Meaning, unit: ColumnUnit | None
) -> Proposal | None:
    """What can be read as a time."""
    if column.words is not None:
        return _of_dates(name, column, meaning)
    if meaning.channel == DATE:
        return None

    known = column.numbers[np.isfinite(column.numbers)]
    if known.size < 3 or np.ptp(known) == 0.0:
        return None
    units, why = _units_of_time(known, unit)
    if not units:
        return None
    options = [Option(f"channel: time, unit: {u}", f"{why}, {_range(known)}") for u in units]
    asks = "in which unit it is" if len(options) > 1 else ""
    return Proposal(name, TIME, meaning.sure, tuple(options), asks)


def _units_of_time(known: Array, unit: ColumnUnit | None) -> tuple[list[str], str]:
    """The units that numbers may be a time in, and why."""
    if unit is not None:
        return [unit.name], "unit of the file"
    if since := likely_unit(known):
        return [since], "since 1970"

    step = float(np.median(np.abs(np.diff(known))))
    low, high = OFTEN
    if DAYS[0] < np.median(known) < DAYS[1] and low < step * 86_400.0 <= high:
        return ["d, epoch: 1899-12-30"], "days of a spreadsheet"
    if DATENUM[0] < np.median(known) < DATENUM[1] and low < step * 86_400.0 <= high:
        return [], ""
    sizes = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
    likely = [name for name, size in sizes.items() if low < step * size <= high]
    return likely or ["s"], f"rows {step:.4g} apart"


def _of_dates(name: str, column: Column, meaning: Meaning) -> Proposal | None:
    """Dates and times of day, in the order in which they can be read."""
    assert column.words is not None
    unit = f", unit: {CLOCK}" if meaning.channel == TIME else ""
    plain = f"channel: {meaning.channel}{unit}"
    why = f"written as {column.words[0][:30]}"
    if _readable(column, meaning.channel):
        return Proposal(name, meaning.channel, meaning.sure, (Option(plain, why),))

    orders = [order for order in ORDERS if _readable(column, meaning.channel, order)]
    options = tuple(Option(f"{plain}, order: {order}", why) for order in orders)
    if not options:
        return None
    return Proposal(name, meaning.channel, meaning.sure, options, "which number is the day")


def _readable(column: Column, channel: str, order: str = "") -> bool:
    try:
        TimeColumn(Mapped(channel, CLOCK, order=order)).column(column)
    except TimeFormatError:
        return False
    return True


def of_day(column: Column) -> bool:
    """Whether a column of time holds times of day, without their dates."""
    if column.words is None:
        return False
    time = TimeColumn(Mapped(TIME, CLOCK))
    try:
        time.column(column)
    except TimeFormatError:
        return False
    return time.period > 0


def _of_runs(name: str, columns: Sequence[Column]) -> Proposal | None:
    """A column of labels, where it parts a file and the labels can be the names of files."""
    first = columns[0]
    labels = first.words or [f"{value:g}" for value in first.numbers.tolist()]
    if len(columns) > 1 and len(set(labels)) == 1:
        return None
    if len(set(labels)) > 0.1 * len(labels) or not all(map(is_file_name, set(labels))):
        return None
    return Proposal(name, "run", 2, (Option("channel: run", "one run for each value"),))


# --- what is measured ---


def _measured(
    name: str, columns: Sequence[Column], meaning: Meaning, unit: ColumnUnit | None
) -> Proposal | None:
    known = [column.numbers[np.isfinite(column.numbers)] for column in columns]
    if not known[0].size or any(np.any(np.abs(values) > LARGEST) for values in known):
        return None
    constant = all(values.size and np.ptp(values) == 0.0 for values in known)
    if constant and meaning.channel == "load":
        text = f"channel: nominal_load, unit: {_unit(unit, 'N')}{_factor(unit, '')}"
        if unit is not None and unit.factor != 1.0:
            return None
        why = f"the same throughout, {known[0][0]:g}"
        return Proposal(name, "nominal_load", meaning.sure, (Option(text, why),))
    if constant and (meaning.channel not in SPEEDS or not any(map(np.any, known))):
        return None
    if not constant and meaning.channel == "nominal_load":
        return None

    channels = _channels(meaning.channel)
    options = tuple(_option(channel, columns[0], known[0], unit) for channel in channels)
    asks = "; ".join(filter(None, (meaning.asks, _doubts(channels[0], known[0], unit))))
    return Proposal(name, meaning.channel, meaning.sure, options, asks)


def _channels(channel: str) -> tuple[str, ...]:
    return {"torque?": tuple(SIDES), "force?": FORCES}.get(channel, (channel,))


def _option(channel: str, column: Column, known: Array, unit: ColumnUnit | None) -> Option:
    guessed = unit is None and channel not in COUNTS
    likely = _unit(unit, _likely_unit(channel, known))
    text = f"channel: {channel}, unit: {likely}{_factor(unit, '1.0')}"
    if np.ptp(known) == 0.0 and not column.resolution:
        text += f", noise: {STEADY * abs(known[0]) or 1e-3:.3g} {likely}"
    text += _wraps(
        channel, known * float(units.unit(likely).factor) * (unit.factor if unit else 1.0)
    )
    side = f"{SIDES[channel]}; " if channel in SIDES else ""
    how = "unit guessed from the values" if guessed else "unit of the file"
    return Option(text, f"{side}{how}, {_range(known)}")


def _wraps(channel: str, turned: Array) -> str:
    """After what an angle (n,) [rad] or a count begins anew, where it does after a whole turn or a
    power of two.
    """
    wrap = wrap_of(turned)
    if channel == "wheel_angle" and abs(wrap / (2.0 * np.pi) - 1.0) < NEAR:
        return ", wraps: 360 deg"
    whole = float(2.0 ** np.round(np.log2(wrap))) if channel in COUNTS and wrap > 1.0 else 0.0
    return f", wraps: {whole:.0f} count" if whole and abs(wrap / whole - 1.0) < NEAR else ""


def _unit(unit: ColumnUnit | None, likely: str) -> str:
    return likely if unit is None else unit.name


def _factor(unit: ColumnUnit | None, plain: str) -> str:
    if unit is None or unit.factor == 1.0 or not plain:
        return ""
    return f", factor: {unit.factor:.7g}"


def _doubts(channel: str, known: Array, unit: ColumnUnit | None) -> str:
    """What else has to be decided: a sign, a unit that nothing tells, counts."""
    doubts = []
    if _falls(channel, known):
        doubts.append(f"{_turned(channel)}: as it is, or factor: -1")
    if np.ptp(known) == 0.0:
        doubts.append("the same throughout: an imposed speed")
    whole = bool(np.all(known == np.round(known)))
    if unit is None and whole and channel in ("wheel_angle", "carriage_position"):
        counted = "wheel_count" if channel == "wheel_angle" else "carriage_count"
        doubts.append(f"whole numbers: counts are channel: {counted}, unit: count, with --config")
    return "; ".join(doubts)


def _falls(channel: str, known: Array) -> bool:
    """Whether a channel that is positive in usual driving is not."""
    if channel in ("wheel_angle", "wheel_count", "carriage_position", "carriage_count"):
        return bool(known[-1] < known[0])
    if channel in SPEEDS or channel in SIGNED:
        share = 0.9 if channel == "drawbar_pull" else 0.5
        return float(np.mean(known < 0.0)) > share
    return False


def _turned(channel: str) -> str:
    return f"mostly negative, and {SIGNED[channel]}" if channel in SIGNED else "it falls"


def _likely_unit(channel: str, known: Array) -> str:
    """A unit in which the values are of a usual size."""
    large = float(np.max(np.abs(known)))
    smaller = {"sinkage": ("mm", 0.5), "carriage_position": ("mm", 20.0), "current": ("mA", 100.0)}
    faster = {
        "carriage_speed": ("mm/s", 1.0),
        "rim_speed": ("mm/s", 1.0),
        "wheel_angle": ("deg", 200.0),
    }
    unit, limit = (smaller | faster).get(channel, ("", np.inf))
    return unit if large > limit else SI.get(channel, MEASURED.get(channel, ("", ""))[0])


def _range(known: Array) -> str:
    """Values in words."""
    return f"{known.min():.4g} to {known.max():.4g}" if known.size else "no numbers"


def shown(column: Column) -> str:
    """What a column holds, in words."""
    if column.words is not None:
        return f"words such as {column.words[0][:20]!r}" if column.words else "nothing"
    return _range(column.numbers[np.isfinite(column.numbers)])
