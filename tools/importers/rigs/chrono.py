"""Project Chrono's single wheel on SCM terrain: motion and forces of a simulator, read by the
packaged testbed's sensors.

A log holds t, angle, x, z, W, DP, T, omega, v at 250 Hz, without any sensor. Encoders,
potentiometer, motor shunt and force/torque sensor of the packaged configuration read it, with noise
of the size that is configured there. T resists in the log where it is negative; the motor's torque
is its opposite. Every file name is a campaign and the number of a run: `base_0.csv.gz`.
"""

from __future__ import annotations

import argparse
import re
import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Calibration, Settings
from gritd.estimator.messages.run_info import RunInfo
from gritd.tools.importers.files import Array, RigFileError, find, numbers, read_table
from gritd.tools.importers.recording import ChannelReadings, stamps, write
from gritd.tools.importers.registry import Tell
from gritd.tools.importers.segments import START

NAME = "chrono"
SUMMARY = "Project Chrono's SCM terrain: a simulator's wheel, read by simulated sensors"

FILE = re.compile(r"([a-z]+)_([0-9]+)\.csv(?:\.gz)?")
COLUMNS = ("t", "angle", "x", "z", "W", "DP", "T", "omega", "v")
TOUCHED = 1.0  # [s] before which the wheel is dropped onto the bed and settles
APART = 120_000_000_000  # [ns] between the starts of two runs


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The seed of the sensors' noise."""
    parser.add_argument(
        "--noise-seed", type=int, default=0, help="of the sensors' noise; default 0"
    )


def run(args: argparse.Namespace, progress: Tell) -> list[Path]:
    """One recording a file, one configuration. Raises RigFileError, RecordingError."""
    files = find(args.paths, FILE)
    if not files:
        raise RigFileError(f"{args.paths[0]}: found no log; expected base_0.csv.gz or the like")
    path = args.output / "chrono.yaml"
    args.output.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(packaged(), path)
    shutil.copyfile(packaged("testbed.dbc"), args.output / "testbed.dbc")
    configured = config.load(path)

    written = [path]
    for number, (file, match) in enumerate(files):
        log = read_log(file)
        load, name = float(np.round(np.mean(log["W"]), 1)), f"{match[1]}-{match[2]}"
        progress(f"{name}: {log['t'].size} samples at {load:g} N")
        rng = np.random.default_rng((args.noise_seed, number))
        streams = _streams(log, configured.settings, START + number * APART, rng)
        info = RunInfo(name=name, nominal_load=load, notes="Project Chrono, SCM terrain")
        written.append(write(args.output / f"{name}.mcap", streams, configured, info))
    return written


def read_log(path: Path) -> dict[str, Array]:
    """The columns of a log, arrays (n,), once the wheel has settled on the bed. Raises
    RigFileError.
    """
    table = read_table(path, COLUMNS)
    log = {name: numbers(path, table, name) for name in COLUMNS}

    settled = log["t"] >= TOUCHED
    if settled.sum() < 100:
        raise RigFileError(
            f"{path}: found {settled.sum()} samples after {TOUCHED:g} s; expected 100"
        )
    return {name: values[settled] for name, values in log.items()}


def _streams(
    log: Mapping[str, Array], settings: Settings, start: int, rng: np.random.Generator
) -> list[ChannelReadings]:
    """What the configured sensors make of a log."""
    channels, wrench, at = settings.channels, settings.wrench, stamps(start, log["t"])
    assert wrench is not None
    encoders = {
        "wheel_encoder": log["angle"],
        "carriage_encoder": log["x"] / settings.pulley_radius,
    }
    analogue = {
        "sinkage_pot": log["z"],
        "motor_shunt": -log["T"] / settings.drive.torque_constant.value,
    }
    forces = np.zeros((at.size, 6))
    noise = (wrench.force_noise, wrench.force_noise, wrench.torque_noise)
    axes = ((0, log["DP"]), (2, log["W"]), (4, -log["T"]))
    for (axis, values), sigma in zip(axes, noise, strict=True):
        forces[:, axis] = values + sigma * rng.standard_normal(at.size)

    streams = [
        ChannelReadings(
            name, at, np.round(_raw(values, channels[name].calibration)).astype(np.int64)
        )
        for name, values in encoders.items()
    ]
    for name, values in analogue.items():
        channel = channels[name]
        read = _raw(values, channel.calibration) + channel.noise * rng.standard_normal(at.size)
        streams.append(ChannelReadings(name, at, read))
    return [*streams, ChannelReadings("wrench", at, forces)]


def _raw(values: Array, calibration: Calibration) -> Array:
    """Counts or volts of physical values (n,)."""
    return np.asarray((values - calibration.offset.value) / calibration.scale.value)
