"""EMPS: a motor drive with friction and no soil, a public identification benchmark (Janot, Gautier,
Brunot 2019).

Position becomes the wheel encoder of a wheel of 1 m, so that its angle is the position, and the
control voltage the motor shunt, so that torque constant times current is the force. The gate
`pulses_N` of DATA_EMPS_PULSES is left out: the pulses it marks are in the control voltage already,
which steps by 5 V at every edge of the gate.
"""

from __future__ import annotations

import argparse
import math
import re
from pathlib import Path

import numpy as np
from scipy.io import loadmat, whosmat

from gritd.estimator.limits import limits, raised
from gritd.estimator.messages.run_info import RunInfo
from gritd.tools.importers.files import LARGEST, Array, RigFileError, find, increasing
from gritd.tools.importers.recording import ChannelReadings, configuration, stamps, write
from gritd.tools.importers.registry import Tell
from gritd.tools.importers.segments import START

NAME = "emps"
SUMMARY = "motor drive with friction, no soil: position and motor force at 1 kHz"

FILE = re.compile(r"DATA_EMPS(_PULSES)?\.mat")
VARIABLES = ("t", "qm", "vir", "gtau")
NUMERIC = ("double", "single", *(f"{u}int{bits}" for u in ("", "u") for bits in (8, 16, 32, 64)))
COUNT = 5e-8  # [m] the last digit of qm in DATA_EMPS


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """None beyond the common ones."""


def run(args: argparse.Namespace, tell: Tell) -> list[Path]:
    """One recording a file, one configuration. Raises RigFileError, RecordingError."""
    logs = {file: read_log(file) for file, _ in find(args.paths, FILE)}
    if not logs:
        raise RigFileError(
            f"{args.paths[0]}: found no log; expected DATA_EMPS.mat or DATA_EMPS_PULSES.mat"
        )

    gains = sorted({float(log["gtau"][0]) for log in logs.values()})
    if len(gains) > 1:
        raise RigFileError(
            f"{next(iter(logs))}: gtau: found {gains[0]:g} and {gains[1]:g}; expected one drive"
        )

    configured = configuration("rig_emps.yaml", args.output, "emps.yaml", gain=f"{gains[0]:.12f}")
    written = [args.output / "emps.yaml"]

    for file, log in logs.items():
        name = file.stem.lower().replace("_", "-")
        tell(f"{name}: {len(log['t'])} samples, position {np.ptp(log['qm']):.4f} m peak to peak")
        info = RunInfo(name=name, notes="drive without soil")
        written.append(write(args.output / f"{name}.mcap", _streams(log), configured, info))

    return written


def read_log(path: Path) -> dict[str, Array]:
    """t [s], qm [m], vir [V], each (n,), and gtau [N/V] (1,). Raises RigFileError."""
    try:
        _check_size(path)
        content = loadmat(path, variable_names=VARIABLES)
    except RigFileError:
        raise
    except Exception as error:  # scipy raises a different one for each kind of damage
        reason = " ".join(str(error).split())
        raise RigFileError(f"{path}: cannot be read: {reason}; expected a MATLAB file") from None

    log = {}
    for name in VARIABLES:
        if name not in content:
            raise RigFileError(f"{path}: found no variable {name}; expected t, qm, vir and gtau")
        log[name] = np.ravel(np.asarray(content[name], dtype=np.float64))

    for name, values in log.items():
        expected = 1 if name == "gtau" else len(log["t"])
        if len(values) != expected or not np.all(np.abs(values) <= LARGEST):
            raise RigFileError(
                f"{path}: {name}: found {len(values)} values; expected {expected}, all finite"
            )

    increasing(path, "t", log["t"], first=1)
    return log


def _check_size(path: Path) -> None:
    """Raises RigFileError unless the variables are numbers, and few enough to be unpacked."""
    most = limits().values
    for name, shape, kind in whosmat(path):
        if name in VARIABLES and (kind not in NUMERIC or math.prod(shape) > most):
            raise RigFileError(
                f"{path}: {name}: found {math.prod(shape)} of kind {kind}; expected no more than "
                f"{most:.0f} numbers; {raised('values')}"
            )


def _streams(log: dict[str, Array]) -> list[ChannelReadings]:
    times = stamps(START, log["t"])
    return [
        ChannelReadings("wheel_encoder", times, np.round(log["qm"] / COUNT).astype(np.int64)),
        ChannelReadings("motor_shunt", times, log["vir"]),
    ]
