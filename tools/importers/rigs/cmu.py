"""CMU: a smooth and a grousered wheel in dry sand (Pavlov and Johnson,
robomechanics/3d-terramechanics).

Four campaigns, a folder each: the steady-state tables of either wheel (motion, sinkage, forces; one
condition a segment) and its raw logs (motion and sinkage). The plates and wheels that were pressed
into the sand become one table, penetration.csv. Only straight driving, steering angle 0, is taken.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Uncertain
from gritd.estimator.messages.run_info import RunInfo
from gritd.tools.cli.command import number
from gritd.tools.importers.files import (
    Array,
    RigFileError,
    find,
    finite_number,
    increasing,
    matrix,
    numbers,
    read_table,
    read_text,
)
from gritd.tools.importers.formats.mat import struct_lists
from gritd.tools.importers.recording import (
    NS,
    ChannelReadings,
    configuration,
    counts,
    stamps,
    write,
)
from gritd.tools.importers.registry import Tell
from gritd.tools.importers.segments import Condition, Counting, check_few, scatter_of_mean, streams

NAME = "cmu"
SUMMARY = "smooth and grousered wheel in dry sand: motion, sinkage, load, drawbar pull; no torque"

# [m] of rim and of carriage travel; 0.01 mm/s, the speeds' last digit, over a sample is 0.14 of it
COUNT = 1e-6
START_HEIGHT = 31.5  # [mm] of the wheel above the sand where a log begins
# [m] by which the sinkage of the smooth wheel's repeats differs, far more than within one
REPEATABLE = 0.7e-3
TRUSTED_MATCH = 0.4  # residual under which a log is known to belong to a table row
CONTACT = 2.0  # [N] force at which a plate has met the sand

TABLE = re.compile(
    r"(?:all_)?(smooth|grouser)_(?:(?:all_trials|first_trial)_steady_state\.csv|data\.mat)"
)
LOG = re.compile(r"gr\d+_(vx_10|grouser)__([\d-]+)__10_(\d+)_0_(\d+)\.txt(?:\.gz)?")
INDEX = re.compile(r"beta0_trials_index\.csv")
PRESSED = re.compile(
    r"(f-d-large-box|testbed-deflection)__force-displacement_(\w+)\.ft\.csv(?:\.gz)?"
)
COLUMNS = (
    "avg_Fx",
    "std_Fx",
    "avg_Fy",
    "std_Fy",
    "avg_Fz",
    "std_Fz",
    "avg_Vx",
    "avg_Vry",
    "avg_Z",
    "std_Z",
)
PLATES = {
    "1": 60,
    "2": 60,
    "3": 60,
    "4": 100,
    "5": 100,
    "6": 100,
    "7": 80,
    "8": 80,
    "9": 80,
}  # run -> diameter [mm]
HOURS_BEHIND = {"f-d-large-box": 5, "testbed-deflection": 4}  # of the rig's clock, by time of year

COUNTING = Counting(COUNT, COUNT, pot_scale=-1e-3, pot_offset=-START_HEIGHT * 1e-3)
SIDE_FORCE = "\n    side_force: {offset: {value: 0 N, sigma: 0.5 N}}"  # a line of its own


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--wheel", choices=("smooth", "grouser"), help="only this wheel; default: both"
    )

    parser.add_argument(
        "--rim-speed",
        type=number(low=0.0),
        action="append",
        default=[],
        metavar="MM/S",
        help="only steady states of this commanded rim speed, the carriage having 10; "
        "may be repeated; default: all",
    )

    parser.add_argument(
        "--steering",
        type=number(low=0.0),
        metavar="DEG",
        help="steady states at this angle between the wheel and its travel, their side force "
        "compared too; default: 0, without",
    )


def run(args: argparse.Namespace, tell: Tell) -> list[Path]:
    """Recordings by wheel and kind, one configuration, penetration.csv. Raises RigFileError,
    RecordingError.
    """
    wheels = [args.wheel] if args.wheel else ["smooth", "grouser"]
    tables, logs, pressed = (find(args.paths, pattern) for pattern in (TABLE, LOG, PRESSED))
    if not (tables or logs or pressed):
        expected = "smooth_all_trials_steady_state.csv or another of those in docs/importing.md"
        raise RigFileError(f"{args.paths[0]}: found none of the rig's files; expected {expected}")

    side = "" if args.steering is None else SIDE_FORCE
    configured = configuration("rig_cmu.yaml", args.output, "cmu.yaml", side_force=side)
    steering = args.steering or 0.0
    written = [args.output / "cmu.yaml"]

    for file, match in tables:
        if match[1] in wheels:
            trials = _numbered(_steered(file, steering, args.rim_speed))
            kind = f"{match[1]}-{steering:g}deg" if steering else match[1]
            written += _import_table(kind, trials, args.output, configured, tell)

    loads = {
        name: load for file, _ in find(args.paths, INDEX) for name, load in _loads(file).items()
    }
    for file, match in logs:
        wheel = "smooth" if match[1] == "vx_10" else "grouser"
        if wheel in wheels:
            written.append(_import_log(file, wheel, loads, args.output, configured))

    if pressed:
        written.append(
            _import_pressed([(file, match[1], match[2]) for file, match in pressed], args.output)
        )

    return written


# --- steady-state tables ---


def _import_table(
    wheel: str,
    trials: list[tuple[float, int, Condition]],
    output: Path,
    configured: config.Configuration,
    tell: Tell,
) -> list[Path]:
    """A recording of each row: it was a trial of its own, with a load of its own."""
    written = []
    tell("steady state     rim [mm/s]    slip   W [N]  DP [N]  z [mm]")
    for speed, repeat, condition in trials:
        name = f"{wheel}-{speed:03.0f}-{repeat}"
        tell(_row(name, condition))

        info = RunInfo(
            name=name,
            nominal_load=round(condition.load.value, 2),
            notes=f"{wheel} wheel; a steady state",
            steady_states=True,
        )
        made = streams([condition], COUNTING)
        written.append(write(output / f"{wheel}-table" / f"{name}.mcap", made, configured, info))

    return written


def _steered(path: Path, angle: float, speeds: list[float]) -> list[tuple[float, Condition]]:
    """Commanded rim speed and condition of each row of one steering angle [°] and some rim speeds
    [mm/s], of all if none is given. Raises RigFileError.
    """
    columns = _of_mat(path) if path.suffix == ".mat" else _of_csv(path)
    steered = columns["beta"] == angle
    chosen = {name: values[steered] for name, values in columns.items()}
    rows = [dict(zip(chosen, values, strict=True)) for values in zip(*chosen.values(), strict=True)]
    if not rows:
        angles = ", ".join(f"{beta:g}" for beta in np.unique(columns["beta"]))
        raise RigFileError(f"{path}: found no row with beta {angle:g}; found {angles}")
    check_few(path, len(rows))
    chosen_rows = [row for row in rows if not speeds or float(row["Vry"]) in speeds]
    if not chosen_rows:
        wanted = ", ".join(f"{speed:g}" for speed in speeds)
        raise RigFileError(f"{path}: found no row of rim speed {wanted} mm/s and beta {angle:g}")
    return [(float(row["Vry"]), _condition(row)) for row in chosen_rows]


def _of_csv(path: Path) -> dict[str, Array]:
    names = ("beta", "Vry", *COLUMNS)
    table = read_table(path, names)
    return {name: numbers(path, table, name) for name in names}


def _of_mat(path: Path) -> dict[str, Array]:
    """The columns of the published MATLAB file: one variable is a list of structures, one a trial,
    whose fields are those of the table. Raises RigFileError.
    """
    names = ("beta", "Vry", *COLUMNS)
    for trials in struct_lists(path):
        if all(name in trials[0] for name in names):
            return {name: _column(path, name, trials) for name in names}
    raise RigFileError(f"{path}: found no trials; expected structures with {', '.join(names)}")


def _column(path: Path, name: str, trials: Sequence[Mapping[str, Any]]) -> Array:
    """One field of all trials as finite numbers. Raises RigFileError."""
    texts = [str(trial.get(name)) for trial in trials]
    return np.array(
        [finite_number(path, f"trial {n}: {name}", t) for n, t in enumerate(texts, start=1)]
    )


def _condition(row: dict[str, float]) -> Condition:
    """The rig's axes: x sideways, y against the pull, z up."""
    return Condition(
        rim_speed=row["avg_Vry"] * 1e-3,
        carriage_speed=row["avg_Vx"] * 1e-3,
        sinkage=scatter_of_mean(-row["avg_Z"] * 1e-3, REPEATABLE),
        load=Uncertain(-row["avg_Fz"], row["std_Fz"]),
        drawbar_pull=Uncertain(-row["avg_Fy"], row["std_Fy"]),
        lateral_force=Uncertain(row["avg_Fx"], row["std_Fx"]),
    )


def _numbered(rows: list[tuple[float, Condition]]) -> list[tuple[float, int, Condition]]:
    """Commanded speed, number of the repeat from 1, and condition; by rising speed."""
    ordered = sorted(rows, key=lambda row: row[0])
    speeds = [speed for speed, _ in ordered]
    return [
        (speed, number_ - speeds.index(speed) + 1, c) for number_, (speed, c) in enumerate(ordered)
    ]


def _row(name: str, condition: Condition) -> str:
    rim, speed = condition.rim_speed, condition.carriage_speed
    slip = (rim - speed) / max(rim, speed)
    pull = condition.drawbar_pull.value if condition.drawbar_pull else float("nan")
    return (
        f"{name:<16} {rim * 1e3:10.2f} {slip:7.3f} {condition.load.value:7.2f} {pull:7.2f} "
        f"{condition.sinkage.value * 1e3:7.2f}"
    )


# --- raw logs ---


def _loads(path: Path) -> dict[str, float]:
    """Load [N] by log, from the table row it is known to belong to."""
    table = read_table(path, ("file", "W_N", "match_resid"))

    return {
        name: finite_number(path, f"{name}: W_N", load)
        for name, load, residual in zip(
            table["file"], table["W_N"], table["match_resid"], strict=True
        )
        if load
        and residual
        and finite_number(path, f"{name}: match_resid", residual) < TRUSTED_MATCH
    }


def _import_log(
    path: Path, wheel: str, loads: dict[str, float], output: Path, configured: config.Configuration
) -> Path:
    """X [mm], Vx, Vry [mm/s], angle [deg], Z [mm], clock [ms], unix time [s] become motion and
    height.

    The carriage's travel is the integral of Vx. X by the log's clock is 2.8 % faster than Vx in
    every log: the controller underestimates its period, and both speeds with it. Their ratio, and
    so the slip, is right.
    """
    rows = matrix(path, 7)
    clock = increasing(path, "the clock", rows[:, 5] / 1000, first=1)
    seconds = clock - clock[0]
    times = stamps(round(rows[0, 6] * 1e3) * (NS // 1000), seconds)

    logged = [
        ChannelReadings("wheel_encoder", times, counts(seconds, rows[:, 2] * 1e-3, COUNT)),
        ChannelReadings("carriage_encoder", times, counts(seconds, rows[:, 1] * 1e-3, COUNT)),
        ChannelReadings("sinkage_pot", times, rows[:, 4] - rows[0, 4]),
    ]

    plain = path.name.removesuffix(".gz")
    name = plain.removesuffix(".txt")

    info = RunInfo(
        name=name,
        nominal_load=loads.get(plain),
        notes=f"{wheel} wheel; raw log; no forces recorded",
    )

    return write(output / f"{wheel}-logs" / f"{name}.mcap", logged, configured, info)


# --- penetration tests ---


@dataclass(frozen=True)
class Penetration:
    """One body pressed down: force [N] and depth [mm] below the height of contact, arrays of shape
    (n,).
    """

    name: str
    body: str
    force: Array
    depth: Array


def _import_pressed(tests: list[tuple[Path, str, str]], output: Path) -> Path:
    """penetration.csv: test, body, depth below contact [mm], force [N], up to the largest force, 20
    rows a second.
    """
    lines = ["test,body,depth_mm,force_N"]
    for file, series, which in tests:
        test = read_penetration(file, series, which)
        lines += [
            f"{test.name},{test.body},{depth:.3f},{force:.2f}"
            for depth, force in zip(test.depth[::5], test.force[::5], strict=True)
        ]

    path = output / "penetration.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def read_penetration(path: Path, series: str, which: str) -> Penetration:
    """Force log (100 Hz) with the height in the rig's log at its times. Raises RigFileError."""
    zero, forces = _forces(path)
    rig = path.with_name(re.sub(r"\.ft\.csv(\.gz)?$", r".rig.txt\1", path.name))
    rows = matrix(rig, 7)
    clock = increasing(rig, "the time", rows[:, 6] + 3600.0 * HOURS_BEHIND[series], first=1)

    force = np.convolve(zero - forces[:, 3], np.full(10, 0.1), "same")
    last = int(np.argmax(force))
    before = np.flatnonzero(force[:last] < CONTACT)

    if not before.size or last - before[-1] < 100:
        raise RigFileError(
            f"{path}: found no loading from under {CONTACT:g} N over a second; expected one"
        )

    height = np.interp(forces[:, 0], clock, rows[:, 4])
    pressed = slice(int(before[-1]), last + 1)

    return Penetration(
        f"{series}-{which}",
        _body(series, which),
        force[pressed],
        height[before[-1]] - height[pressed],
    )


def _forces(path: Path) -> tuple[float, Array]:
    """Zero of Fz [N], and rows of time [s], Fx … Tz."""
    header = re.match(r"# zero offsets[^:]*:((?: *,? *-?[\d.]+){6})\n", read_text(path))
    if not header:
        raise RigFileError(
            f"{path}: row 1: found no zero offsets; expected '# zero offsets …: Fx,Fy,Fz,Tx,Ty,Tz'"
        )
    return finite_number(path, "row 1", header[1].split(",")[2]), matrix(path, 7, skip=2)


def _body(series: str, which: str) -> str:
    if series == "testbed-deflection":
        return "rigid stop"
    return f"plate {PLATES[which]} mm" if which in PLATES else f"{which.split('_')[0]} wheel"
