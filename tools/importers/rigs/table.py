"""A table of steady states, one condition a row: slip, load, drawbar pull, sinkage and torque, as
papers print them.

The columns are those of the public roverdevkit repository's digitised experiments (Ding et al. 2011
among them). Torque at the axle stands as the current of a drive of 1 N·m/A, so that the on-line
filter runs on it. A table has no speed, so one is assumed; nothing in Eqs. (1)–(22) depends on it.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from gritd.estimator.messages.run_info import RunInfo
from gritd.tools.cli.command import number
from gritd.tools.importers.files import (
    RigFileError,
    Table,
    find,
    finite_number,
    lines,
    numbers,
    read_table,
)
from gritd.tools.importers.recording import configuration, write
from gritd.tools.importers.registry import Tell
from gritd.tools.importers.segments import (
    Condition,
    Counting,
    check_few,
    reading_sigma,
    scatter_of_mean,
    streams,
)

NAME = "table"
SUMMARY = (
    "steady states from a table, one condition a row: slip, load, drawbar pull, sinkage, torque"
)

CSV = re.compile(r".*\.csv(?:\.gz)?")
CONSTANTS = ("source", "wheel_radius_m", "wheel_width_m", "soil_simulant", "soil_shear_modulus_k_m")
MEASURED = ("vertical_load_n", "slip", "meas_drawbar_pull_n", "meas_sinkage_m")
LUGS = ("grouser_height_m", "grouser_count")  # a table may lack them
TORQUE = "meas_torque_nm"  # a table, or one wheel of it, may lack it
# channel -> unit, column, and how well a value is read from a printed figure
MEASURED_ERRORS = {
    "drawbar-pull": ("N", "meas_drawbar_pull_n", 0.5),
    "sinkage": ("m", "meas_sinkage_m", 0.25e-3),
    "torque": ("N·m", TORQUE, 0.1),
}
SAME_SLIP = 0.005  # slips that differ by less were meant to be one
ALIKE = 0.02  # relative difference of loads that were meant to be one
SOIL = (
    "simulant",
    "n",
    "k_c_kN_per_m_n_plus_1",
    "k_phi_kN_per_m_n_plus_2",
    "cohesion_kPa",
    "friction_angle_deg",
)
# [rad/s] of the wheel where none is stated: in a second it rolls its contact over, and what it
# reads from then on is that of steady motion
TURNING = 0.5
COUNT = 1e-6  # [m] of rim or carriage travel
COUNTING = Counting(COUNT, COUNT, pot_scale=1.0, pot_offset=0.0)
NOT_TAKEN = "not taken from the tables but left to be found: any soil from sand to clay."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--speed",
        type=number(above=0.0),
        metavar="M/S",
        help="of the faster of rim and carriage; default: half a wheel's radius a second",
    )

    for name, (unit, _, least) in MEASURED_ERRORS.items():
        explained = (
            f"standard deviation of a tabulated value [{unit}]; else how repeats differ, "
            f"at least {least:g}"
        )
        parser.add_argument(
            f"--{name}-sigma", type=number(above=0.0), metavar="SIGMA", help=explained
        )

    parser.add_argument(
        "--load-sigma",
        type=number(above=0.0),
        metavar="SIGMA",
        help="standard deviation of a tabulated load [N]; else their scatter and last digit",
    )

    parser.add_argument(
        "--soil-strength",
        choices=("unknown", "table"),
        default="unknown",
        help="cohesion and friction angle: of any soil from sand to clay, or as tabulated",
    )


def run(args: argparse.Namespace, tell: Tell) -> list[Path]:
    """One recording and one configuration for each wheel on each soil of a table. Raises
    RigFileError, RecordingError.
    """
    files = [file for file, _ in find(args.paths, CSV)]
    tables = [file for file in files if _has(file, "slip")]
    if not tables:
        raise RigFileError(
            f"{args.paths[0]}: found no table; expected a CSV file with "
            f"{', '.join(CONSTANTS + MEASURED)}"
        )

    soils = [file for file in files if _has(file, SOIL[0])]

    written = []
    for path in tables:
        written += _import(path, soils, args, tell)

    return written


def _has(path: Path, column: str) -> bool:
    return column in next(lines(path), "").split(",")


def _import(path: Path, soils: list[Path], args: argparse.Namespace, tell: Tell) -> list[Path]:
    further = [name for name in (*LUGS, TORQUE) if _has(path, name)]
    whole = read_table(path, [*CONSTANTS, *MEASURED, *further])
    check_few(path, len(whole[MEASURED[0]]))
    stem = path.name.partition(".")[0]

    groups = list(_groups(whole))
    written = []
    for at, (rows, table) in enumerate(groups, start=1):
        name = stem if len(groups) == 1 else f"{stem}-{at}"
        written += _import_group(path, name, rows, table, soils, args)
        tell(_in_two_lines(name, table, errors(table, args)))
    return written


def _groups(table: Table) -> Iterator[tuple[list[int], Table]]:
    """The rows of each wheel on each soil with their numbers in the file, in the file's order. A
    wheel of other lugs is another wheel.
    """
    constants = [name for name in (*CONSTANTS, *LUGS) if name in table]
    keys = list(zip(*(table[name] for name in constants), strict=True))
    for key in dict.fromkeys(keys):
        chosen = [at for at, each in enumerate(keys) if each == key]
        rows = {name: [column[at] for at in chosen] for name, column in table.items()}
        if not any(map(str.strip, rows.get(TORQUE, ()))):
            rows.pop(TORQUE, None)
        yield [at + 2 for at in chosen], rows


def _in_two_lines(name: str, table: Table, sigma: Mapping[str, float]) -> str:
    """A group, and the errors its values are taken to have, in two lines."""
    loads = np.array([float(text) for text in table["vertical_load_n"]])
    lugs = "".join(f", {name} {table[name][0]}" for name in LUGS if name in table)
    without = "" if TORQUE in table else ", no torque"

    units = {channel: unit for channel, (unit, _, _) in MEASURED_ERRORS.items()}
    taken = ", ".join(
        f"{channel} {value:.2g} {units.get(channel, 'N')}"
        for channel, value in sigma.items()
        if channel != "torque" or TORQUE in table
    )

    return (
        f"{name}: {loads.size} steady states, mean load {loads.mean():.1f} N, radius "
        f"{table['wheel_radius_m'][0]} m, {table['soil_simulant'][0]}{lugs}{without}\n"
        f"{name}: taken as uncertain by {taken}"
    )


def _import_group(
    path: Path,
    name: str,
    rows: list[int],
    table: Table,
    soils: list[Path],
    args: argparse.Namespace,
) -> list[Path]:
    conditions = _conditions(path, rows, table, args)
    values = _values(path, table, soils, args)
    configured = configuration("rig_table.yaml", args.output, f"{name}.yaml", **values)

    load = float(np.mean([condition.load.value for condition in conditions]))
    notes = f"{len(conditions)} steady states from a table"
    info = RunInfo(name=name, nominal_load=round(load, 2), notes=notes, steady_states=True)
    made = streams(conditions, COUNTING)
    recording = write(args.output / f"{name}.mcap", made, configured, info)
    return [args.output / f"{name}.yaml", recording]


def _conditions(
    path: Path, rows: list[int], table: Table, args: argparse.Namespace
) -> list[Condition]:
    columns = [numbers(path, table, name, rows).tolist() for name in MEASURED]
    speed = args.speed or TURNING * _radius(path, table)
    has = TORQUE in table
    torques = numbers(path, table, TORQUE, rows).tolist() if has else [None] * len(rows)
    sigma, conditions = errors(table, args), []

    for row, load, slip, pull, sinkage, torque in zip(rows, *columns, torques, strict=True):
        if not -1.0 <= slip <= 1.0 or load <= 0.0:
            raise RigFileError(
                f"{path}: row {row}: found slip {slip:g}, load {load:g}; expected -1 … 1, above 0 N"
            )

        conditions.append(
            Condition(
                rim_speed=speed * min(1.0, 1.0 + slip),
                carriage_speed=speed * min(1.0, 1.0 - slip),
                sinkage=scatter_of_mean(sinkage, sigma["sinkage"]),
                load=scatter_of_mean(load, sigma["load"]),
                drawbar_pull=scatter_of_mean(pull, sigma["drawbar-pull"]),
                current=None if torque is None else scatter_of_mean(torque, sigma["torque"]),
            )
        )

    return conditions


def errors(table: Table, args: argparse.Namespace) -> dict[str, float]:
    """Standard deviation of a tabulated value by channel, SI: as stated; else how repeats of one
    condition differ, and at least what reading a printed figure leaves open.
    """
    stated = vars(args)
    sigmas = {
        channel: stated[f"{channel.replace('-', '_')}_sigma"]
        or max(repeat_scatter(table, column) if column in table else 0.0, least)
        for channel, (_, column, least) in MEASURED_ERRORS.items()
    }
    return sigmas | {"load": args.load_sigma or load_scatter(table["vertical_load_n"])}


def repeat_scatter(table: Table, column: str) -> float:
    """Pooled standard deviation of the values of rows at one load and slip; 0 without repeats."""
    loads, slips, values = (
        np.array([float(text) for text in table[name]])
        for name in ("vertical_load_n", "slip", column)
    )

    left, squares, freedom = np.ones(values.size, dtype=bool), 0.0, 0
    for load, slip in zip(loads, slips, strict=True):
        one = left & (np.abs(loads - load) <= ALIKE * load) & (np.abs(slips - slip) <= SAME_SLIP)
        if one.any():
            squares += float(((values[one] - values[one].mean()) ** 2).sum())
            freedom += int(one.sum()) - 1
        left &= ~one

    return math.sqrt(squares / freedom) if freedom else 0.0


def load_scatter(texts: Sequence[str]) -> float:
    """Standard deviation [N] of tabulated loads: how those differ that were meant to be one, within
    ALIKE of each other, and the rounding to their last digit at least.
    """
    loads = np.sort(np.array([float(text) for text in texts]))
    last = min(10.0 ** -len(text.partition(".")[2]) for text in texts)
    clusters = np.split(loads, np.flatnonzero(np.diff(loads) > ALIKE * loads[:-1]) + 1)

    squares = sum(float(((each - each.mean()) ** 2).sum()) for each in clusters)
    freedom = loads.size - len(clusters)
    scatter = math.sqrt(squares / freedom) if freedom else 0.0
    return max(scatter, last / math.sqrt(12.0))


def _values(
    path: Path, table: Table, soils: list[Path], args: argparse.Namespace
) -> dict[str, str]:
    """What the configuration's template asks for."""
    constant = {name: _constant(path, table, name) for name in CONSTANTS}
    soil = _soil(path, soils, constant["soil_simulant"])
    radius = _radius(path, table)
    shear = finite_number(path, "soil_shear_modulus_k_m", constant["soil_shear_modulus_k_m"])
    sigma = errors(table, args)

    values: dict[str, float] = {
        "radius": radius,
        "width": finite_number(path, "wheel_width_m", constant["wheel_width_m"]),
        "wheel_count": 1e3 * COUNT / radius,
        "load": float(np.mean(numbers(path, table, "vertical_load_n"))),
        "shear_modulus": shear,
        "shear_modulus_sigma": 0.2 * shear,
        "exponent": soil["n"],
        "exponent_sigma": 0.1 * soil["n"],
        "k_c": soil["k_c_kN_per_m_n_plus_1"],
        "k_phi": soil["k_phi_kN_per_m_n_plus_2"],
        "sinkage_sigma": sigma["sinkage"],
        "torque_sigma": sigma["torque"],
        "drawbar_pull_sigma": sigma["drawbar-pull"],
        "sinkage_noise": reading_sigma(sigma["sinkage"]),
        "torque_noise": reading_sigma(sigma["torque"]),
        "force_noise": reading_sigma(max(sigma["drawbar-pull"], sigma["load"])),
    }

    strength, comment = _strength(soil, args.soil_strength)
    return {name: f"{value:.9f}" for name, value in (values | strength).items()} | {
        "source": constant["source"],
        "strength": comment,
        "torque_source": "motor_shunt" if TORQUE in table else "none",
    }


def _radius(path: Path, table: Table) -> float:
    """[m] of the wheel. Raises RigFileError."""
    radius = finite_number(path, "wheel_radius_m", _constant(path, table, "wheel_radius_m"))
    if radius <= 0.0:
        raise RigFileError(f"{path}: wheel_radius_m: found {radius:g}; expected more than 0 m")
    return radius


def _strength(soil: dict[str, float], source: str) -> tuple[dict[str, float], str]:
    """Prior of cohesion [Pa] and tan φ, and the sentence that says where it is from."""
    if source == "unknown":
        return {
            "cohesion": 2000.0,
            "cohesion_sigma": 2000.0,
            "tan_phi": 0.5,
            "tan_phi_sigma": 0.2,
        }, NOT_TAKEN

    cohesion, tan_phi = (
        soil["cohesion_kPa"] * 1e3,
        math.tan(math.radians(soil["friction_angle_deg"])),
    )

    sigmas = {"cohesion_sigma": max(100.0, 0.5 * cohesion), "tan_phi_sigma": 0.1 * tan_phi}
    return {"cohesion": cohesion, "tan_phi": tan_phi, **sigmas}, "as tabulated."


def _constant(path: Path, table: Table, name: str) -> str:
    """The one value of a column. Raises RigFileError where rows differ."""
    values = sorted(set(table[name]))
    if len(values) > 1:
        raise RigFileError(
            f"{path}: {name}: found {values[0]!r} and {values[1]!r}; "
            "expected one value for all rows"
        )
    return values[0]


def _soil(path: Path, soils: Iterable[Path], name: str) -> dict[str, float]:
    """The soil's row among the tables of soils. Raises RigFileError."""
    for file in soils:
        table = read_table(file, SOIL)
        if name in table[SOIL[0]]:
            row = table[SOIL[0]].index(name)
            return {key: finite_number(file, f"{name}: {key}", table[key][row]) for key in SOIL[1:]}
    raise RigFileError(
        f"{path}: soil_simulant: found {name!r} in no table of soils; "
        f"expected one with {', '.join(SOIL)}"
    )
