"""MGST: a smooth wheel in GRC-1 lunar simulant, one slip a trial (Daca, Tremblay, Skonieczny 2023).

A trial is two files on two clocks: the rig's log (100 Hz: speeds, current, potentiometer) and the
authors' processed force/torque log (about 277 Hz). Their time zeros are unrelated: the first is the
start of the log, the second the first steep rise of the drawbar pull. The processed file carries
the rig's current too, but interpolated as if the zeros were one, so it says nothing of the lag;
what both clocks do see is the axle torque, by current and by sensor.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gritd.estimator.messages.run_info import RunInfo
from gritd.tools.cli.command import number
from gritd.tools.importers.files import Array, RigFileError, find, increasing, numbers, read_table
from gritd.tools.importers.recording import (
    UNKNOWN,
    ChannelReadings,
    configuration,
    counts,
    stamps,
    write,
)
from gritd.tools.importers.registry import Tell

NAME = "mgst"
SUMMARY = (
    "single wheel in GRC-1 simulant: motion, sinkage, current, load, drawbar pull, axle torque"
)

RADIUS = 0.075  # [m] of the wheel on the ground
QUANTUM = 1.96665e-3  # [m/s] of its rim speed; the motor's own quantum times the radius
RADII = (0.075, 0.15)  # [m] of the wheels on the ground and in flight
ALIKE = 0.02  # relative difference of a radius that is one of these
WHEEL_COUNT = QUANTUM * 0.01 / RADIUS  # [rad] quantum of the wheel's speed over one sample
CARRIAGE_COUNT = 9.5367e-6 * 0.01  # [m] quantum of the carriage speed over one sample
TORQUE_PER_AMPERE = 6.2  # [N·m/A]
COUNTS_PER_MM = 132.24
WALL_FRICTION = 0.25  # the authors' friction coefficient of wheel on side wall
TORQUE_OFFSET, TORQUE_CROSSTALK = 0.54, 0.185  # [N·m], [m] from the sensor's torque to the axle's
REST = 10  # samples before the wheel has moved
STEADY = 3.0  # [s] of the rig's clock from which speeds are steady

RIG_FILE = re.compile(r"(\d{8})-(\d{6})-trio-s(\d\d)-.*(?:\.rig\.csv(?:\.gz)?|_combined\.CSV)")
SENSOR_FILE = re.compile(r"1-g_(\d\d)-(\d{6})(?:\.processed)?\.csv(?:\.gz)?")
RIG_COLUMNS = ("timestamp", "maxon_current", "maxon_velmes", "akd_velmes", "sinkage")
SENSOR_COLUMNS = ("Timestamp", "dp", "fn", "torque", "dp_raw")

CONCEALABLE = ("torque", "drawbar_pull", "lateral_force", "motor_shunt", "sinkage_pot")


@dataclass(frozen=True)
class RigLog:
    """The rig's log: arrays of shape (n,), the first instant at t = 0."""

    start: int  # [ns since the epoch] the log's time of day, taken as UTC
    t: Array  # [s]
    current: Array  # [mA]
    rim_speed: Array  # rω [m/s]
    carriage_speed: Array  # [m/s]
    sinkage: Array  # [counts] since rest
    radius: float = RADIUS  # [m] of the wheel


@dataclass(frozen=True)
class WrenchLog:
    """The force/torque log: arrays of shape (n,), t = 0 at its own first sample."""

    t: Array  # [s]
    drawbar_pull: Array  # [N] corrected for the side wall
    drawbar_pull_raw: Array  # [N] as sensed
    load: Array  # [N]
    torque: Array  # about the axle [N·m], positive when driving


@dataclass(frozen=True)
class MgstTrial:
    name: str
    slip: int  # nominal [%]
    rig: RigLog
    sensor: WrenchLog


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--drawbar-pull",
        choices=("corrected", "raw"),
        default="corrected",
        help="with (default) or without the authors' correction for rubbing on the side wall",
    )

    parser.add_argument(
        "--conceal",
        choices=CONCEALABLE,
        action="append",
        default=[],
        help="leave a channel out of the recordings; may be repeated",
    )

    parser.add_argument(
        "--begin",
        type=number(above=0.0),
        metavar="SECONDS",
        help="leave out what comes before this time of the rig's log",
    )

    parser.add_argument(
        "--lag",
        type=number(above=0.0),
        metavar="SECONDS",
        help="of the force/torque log behind the rig's; default: correlate",
    )


def run(args: argparse.Namespace, tell: Tell) -> list[Path]:
    """One recording a trial, one configuration for all. Raises RigFileError, RecordingError."""
    trials = [read_trial(*pair) for pair in _pairs(args.paths)]

    known = {"drawbar_pull": "2", "torque": "0.3"}
    sigmas = {
        f"{name}_sigma": f"{UNKNOWN:.1f}" if name in args.conceal else text
        for name, text in known.items()
    }
    source = "motor_shunt" if "torque" in args.conceal else "wrench"
    values = {"torque_source": source, **_wheel(trials), **sigmas}
    configured = configuration("rig_mgst.yaml", args.output, "mgst.yaml", **values)
    written = [args.output / "mgst.yaml"]

    tell(HEADER)

    for trial in trials:
        lag, correlation = find_lag(trial) if args.lag is None else (args.lag, float("nan"))
        if lag + STEADY >= trial.rig.t[-1]:
            raise RigFileError(
                f"{trial.name}: found a lag of {lag:g} s; expected less, "
                f"the log has {trial.rig.t[-1]:.1f} s"
            )

        tell(_row(trial, lag, correlation))
        streams = _streams(trial, lag, args.begin or 0.0, args.drawbar_pull, set(args.conceal))
        info = _info(trial, lag, args.drawbar_pull, args.conceal)
        written.append(write(args.output / f"{trial.name}.mcap", streams, configured, info))

    return written


def _wheel(trials: Sequence[MgstTrial]) -> dict[str, str]:
    """Radius of the one wheel of all trials, and what follows. Raises RigFileError."""
    radius = trials[0].rig.radius
    other = next((trial for trial in trials if trial.rig.radius != radius), None)
    if other is not None:
        raise RigFileError(
            f"{other.name}: found a wheel of radius {other.rig.radius:g} m beside one of "
            f"{radius:g} m; expected one wheel an import"
        )

    ground = radius == RADIUS
    return {
        "radius": f"{1e3 * radius:g}",
        "where": "GRC-1, Earth gravity" if ground else "GRC-1, the wheel of the flights",
        "static_sigma": "8" if ground else "20",
    }


# --- reading ---


def _pairs(paths: list[Path]) -> list[tuple[Path, Path, re.Match[str]]]:
    """Rig log, force/torque log and the matched name of each trial, by time of day."""
    rigs = find(paths, RIG_FILE)
    sensors = {match[2]: file for file, match in find(paths, SENSOR_FILE)}

    if not rigs:
        raise RigFileError(
            f"{paths[0]}: found no rig log; expected files like "
            "20210208-165209-trio-s20-p925.rig.csv"
        )

    for file, match in rigs:
        if match[2] not in sensors:
            raise RigFileError(
                f"{file}: found no sensor log; expected 1-g_{match[3]}-{match[2]}.processed.csv.gz"
            )

    return [(file, sensors[match[2]], match) for file, match in rigs]


def read_trial(rig: Path, sensor: Path, name: re.Match[str]) -> MgstTrial:
    """Both logs of a trial. Raises RigFileError."""
    return MgstTrial(
        f"mgst-{name[3]}-{name[2]}", int(name[3]), _read_rig(rig, name[1]), _read_sensor(sensor)
    )


def _read_rig(path: Path, date: str) -> RigLog:
    table = read_table(path, RIG_COLUMNS)
    clock = increasing(path, "timestamp", _times(path, table["timestamp"]))
    counted = numbers(path, table, "sinkage")
    rim_speed = numbers(path, table, "maxon_velmes") * 1e-3

    return RigLog(
        start=_midnight(path, date) + round(clock[0] * 1e9),
        t=clock - clock[0],
        current=numbers(path, table, "maxon_current"),
        rim_speed=rim_speed,
        carriage_speed=-numbers(path, table, "akd_velmes") * 1e-3,
        sinkage=counted - np.mean(counted[:REST]),
        radius=_radius(path, rim_speed),
    )


def _radius(path: Path, rim_speed: Array) -> float:
    """The wheel's radius from the quantum of its rim speed, whatever the file is called: the motor
    tells its speed in the same steps with every wheel. Raises RigFileError.
    """
    values = np.unique(rim_speed.round(7))
    if values.size < 3:
        return RADIUS  # too few to tell a step

    radius_seen = RADIUS * float(np.min(np.diff(values))) / QUANTUM
    known = [radius for radius in RADII if abs(radius_seen / radius - 1.0) < ALIKE]
    if not known:
        raise RigFileError(
            f"{path}: maxon_velmes: found steps of {1e3 * np.min(np.diff(values)):.4g} mm/s, as of "
            f"a wheel of radius {radius_seen:.3g} m; expected one of {RADII[0]:g} or {RADII[1]:g} m"
        )

    return known[0]


def _read_sensor(path: Path) -> WrenchLog:
    table = read_table(path, SENSOR_COLUMNS)
    raw = numbers(path, table, "dp_raw")
    return WrenchLog(
        t=increasing(path, "Timestamp", _times(path, table["Timestamp"])),
        drawbar_pull=numbers(path, table, "dp"),
        drawbar_pull_raw=raw,
        load=numbers(path, table, "fn"),
        torque=numbers(path, table, "torque") - TORQUE_OFFSET - TORQUE_CROSSTALK * raw,
    )


def _times(path: Path, texts: list[str]) -> Array:
    """Seconds of `16:52:18.010000` or `0 days 00:00:00.003997`, shape (n,)."""
    matches = [re.fullmatch(r"(?:0 days )?(\d+):(\d\d):(\d\d(?:\.\d+)?)", text) for text in texts]
    for row, (text, match) in enumerate(zip(texts, matches, strict=True), start=2):
        if match is None:
            raise RigFileError(
                f"{path}: row {row}: found {text[:40]!r}; expected a time such as 16:52:18.010000"
            )
    return np.array([int(m[1]) * 3600 + int(m[2]) * 60 + float(m[3]) for m in matches if m])


def _midnight(path: Path, date: str) -> int:
    try:
        return (
            int(datetime.strptime(date, "%Y%m%d").replace(tzinfo=UTC).timestamp()) * 1_000_000_000
        )
    except ValueError:
        raise RigFileError(
            f"{path}: found {date} in its name; expected a date such as 20210208"
        ) from None


# --- the two clocks ---


def find_lag(trial: MgstTrial) -> tuple[float, float]:
    """Lag [s] of the force/torque log's zero behind the rig's, and the correlation there.

    Where motor torque (rig) and axle torque (sensor) agree best in steady driving, over 0.2 to 1 s:
    both smoothed over 60 ms and freed of what changes over more than 1.2 s. The start is left out,
    since drivetrain friction delays the torque there. The peak is as broad as the fluctuations are
    slow: about ± 0.1 s.
    """
    grid = np.arange(0.0, min(trial.rig.t[-1], trial.sensor.t[-1]), 0.01)
    motor = _fluctuation(np.interp(grid, trial.rig.t, trial.rig.current))
    axle = _fluctuation(np.interp(grid, trial.sensor.t, trial.sensor.torque))

    begin = 150
    if len(grid) < begin + 300:
        raise RigFileError(
            f"{trial.name}: found {grid.size / 100:.1f} s of data; expected 4.5 s or more, or --lag"
        )

    lags = np.arange(20, 101)
    fits = [
        float(np.corrcoef(motor[begin:], axle[begin - lag : len(axle) - lag])[0, 1]) for lag in lags
    ]

    best = int(np.argmax(fits))
    return float(lags[best]) / 100, fits[best]


def _fluctuation(values: Array) -> Array:
    smooth: Array = gaussian_filter1d(values, 6)
    trend: Array = gaussian_filter1d(smooth, 120)
    return smooth - trend


# --- writing ---


def _streams(
    trial: MgstTrial, lag: float, begin: float, pull: str, concealed: set[str]
) -> list[ChannelReadings]:
    """The channels from `begin` (0 is the start of the wheel, a little before the first force) to
    where a log ends.
    """
    rig, sensor = trial.rig, trial.sensor
    shared = (rig.t >= begin) & (rig.t <= lag + sensor.t[-1])
    times = stamps(rig.start, rig.t)[shared]
    wheel = counts(rig.t, rig.rim_speed / rig.radius, WHEEL_COUNT)
    carriage = counts(rig.t, rig.carriage_speed, CARRIAGE_COUNT)

    logged = {
        "wheel_encoder": wheel,
        "carriage_encoder": carriage,
        "sinkage_pot": rig.sinkage,
        "motor_shunt": rig.current,
    }

    streams = [ChannelReadings(name, times, values[shared]) for name, values in logged.items()]
    inside = (sensor.t + lag >= begin) & (sensor.t + lag <= rig.t[-1])
    sensed = stamps(rig.start, sensor.t + lag)[inside]
    streams.append(ChannelReadings("wrench", sensed, _wrench(sensor, pull, concealed)[inside]))

    return [stream for stream in streams if stream.channel not in concealed]


def _wrench(sensor: WrenchLog, pull: str, concealed: set[str]) -> Array:
    """Six axes, shape (n, 6); an axis that is not measured, or is concealed, is zero."""
    wrench = np.zeros((len(sensor.t), 6))
    if "drawbar_pull" not in concealed:
        wrench[:, 0] = sensor.drawbar_pull if pull == "corrected" else sensor.drawbar_pull_raw
    if "lateral_force" not in concealed:
        wrench[:, 1] = (sensor.drawbar_pull - sensor.drawbar_pull_raw) / WALL_FRICTION
    wrench[:, 2] = sensor.load
    if "torque" not in concealed:
        wrench[:, 4] = sensor.torque
    return wrench


def _info(trial: MgstTrial, lag: float, pull: str, concealed: list[str]) -> RunInfo:
    hidden = ", ".join(sorted(set(concealed))) or "nothing"
    notes = (
        f"slip {trial.slip} %; drawbar pull {pull}; sensor log lags {lag:.2f} s; concealed: "
        f"{hidden}"
    )
    return RunInfo(
        name=trial.name, nominal_load=round(float(np.mean(trial.sensor.load)), 1), notes=notes
    )


# --- what the table shows ---

HEADER = (
    "means from 3 s on     slip   W [N]  DP [N]  DP raw  T axle  T motor  differ [N·m]  z - z0 "
    "[mm]  lag [s]     r"
)


def _row(trial: MgstTrial, lag: float, correlation: float) -> str:
    rig, sensor = trial.rig, trial.sensor
    end = lag + sensor.t[-1]
    driving = (rig.t > STEADY) & (rig.t < end)
    sensed = (sensor.t + lag > STEADY) & (sensor.t + lag < rig.t[-1])

    slip = 1.0 - np.mean(rig.carriage_speed[driving]) / np.mean(rig.rim_speed[driving])
    motor = TORQUE_PER_AMPERE * np.mean(rig.current[driving]) * 1e-3
    axle = np.mean(sensor.torque[sensed])
    pull, raw = np.mean(sensor.drawbar_pull[sensed]), np.mean(sensor.drawbar_pull_raw[sensed])
    sinkage = np.mean(rig.sinkage[driving]) / COUNTS_PER_MM

    return (
        f"{trial.name:<18} {slip:7.4f} {np.mean(sensor.load[sensed]):7.1f} {pull:7.1f} {raw:7.1f} "
        f"{axle:7.2f} "
        f"{motor:8.2f} {motor - axle:13.2f} {sinkage:12.2f} {lag:8.2f} {correlation:5.2f}"
    )
