"""The daemon at work: `gritd run` as a process of its own against the simulated testbed on
pseudo-terminals. When the first estimate comes, how late its ticks are, what it takes of a core and
of memory; and how late a loop is that only sleeps (control.py).
"""

from __future__ import annotations

import os
import re
import time
from math import inf
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gritd.config import packaged
from gritd.estimator.config.configuration import load
from gritd.estimator.messages.readings import NS
from gritd.estimator.recording.cdr import Rows
from gritd.estimator.recording.salvage import read
from gritd.estimator.threads.stop_request import StopRequest
from gritd.tools.cli.child import Child
from gritd.tools.cli.command import FAILED, CommandError

READY = 120.0  # [s] the longest that the testbed or a device may take
SETTLED = 3.0  # [s] after the command everything has been opened and imported
# [s] for which the testbed plays before the command, so that the wheel drives steadily, and after
BEFORE, SPARE = 2.0, 40.0
QUANTILES = (("median", 0.5), ("at_99_percent", 0.99), ("at_99.9_percent", 0.999), ("worst", 1.0))

Figures = dict[str, float]


def live(seconds: float, folder: Path, configuration: Path | None = None) -> Figures:
    """Times in s of the wall clock, beginning with the command; memory in bytes.

    folder: of the run; configuration: of the testbed, else the packaged one.
    """
    folder.mkdir()
    stop = StopRequest()
    options = ["--seconds", str(BEFORE + seconds + SPARE), "--folder", str(folder), "--wait"]
    options += ["--can", "slcan", "--config", str(configuration or packaged())]
    rate, noted = load(configuration or packaged()).settings.rates.tick, folder / "control.npy"

    with Child(stop, "testbed", "gritd.tools.testbed.testbed", *options) as testbed:
        config = testbed.wait_for("configuration ", READY).split(" ", 1)[1]
        testbed.tell("play")
        time.sleep(BEFORE)
        began, clock = time.time(), time.monotonic()
        with (
            Child(stop, "control", "gritd.tools.bench.control", str(rate), str(noted)) as control,
            Child(stop, "daemon", "gritd", "run", "--config", config, "--name", "live") as daemon,
        ):
            settled, started, begun = 0.0, 0.0, inf
            while (elapsed := time.monotonic() - clock) < min(begun, SPARE - SETTLED) + seconds:
                daemon.line(0.2)
                if begun == inf and any(folder.glob("*.mcap")):
                    begun = elapsed + SETTLED
                if not settled and elapsed > begun:
                    settled, started = elapsed, _used(daemon.pid)[0]
            used, memory = _used(daemon.pid)
            daemon.stop()
            control.stop()

    recordings = [read(path) for path in folder.glob("*.mcap")]
    if not recordings or not np.any(recordings[0].arrays("/tick")["updates"]):
        raise CommandError(
            f"bench: the daemon made no estimate within {elapsed:.0f} s: the machine is too busy; "
            "repeat when it does less",
            FAILED,
        )
    recording = recordings[0]
    loop = recording.arrays("/loop")
    return {
        **_started(recording.arrays("/tick"), began),
        "memory": memory,
        "share_of_a_core": used / elapsed,
        "share_at_work": (used - started) / (elapsed - settled),
        **_punctual(loop),
        **beside(loop, np.load(noted), rate),
    }


def at_rate(hertz: float, folder: Path) -> Path:
    """The packaged testbed, its sensors and its loop at another rate, in a folder that is made."""
    folder.mkdir()
    packed = Path(packaged())
    text, rates = re.subn(r"tick: [\d.]+ Hz", f"tick: {hertz:g} Hz", packed.read_text("utf-8"))
    assert rates == 1, f"{packed}: found {rates} rates of ticks, expected one"
    for file in packed.parent.glob("*.dbc"):
        (folder / file.name).write_bytes(file.read_bytes())
    path = folder / "testbed.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def _started(ticks: Rows, began: float) -> Figures:
    """When the first tick and the first estimate came, after the command."""
    estimated = ticks["stamp"][ticks["updates"] > 0]
    return {
        "first_tick": float(ticks["stamp"][0]) / 1e9 - began,
        "first_estimate": float(estimated[0]) / 1e9 - began,
    }


def _punctual(loop: Rows) -> Figures:
    """How late ticks began and how long they took; and how many were left out."""
    figures: Figures = {}
    for name in ("lateness", "duration"):
        for label, share in QUANTILES:
            figures[f"{name}_{label}"] = float(np.quantile(loop[name], share))

    at_work = loop[loop["stamp"] > loop["stamp"][0] + round(SETTLED * NS)]
    return figures | {
        "ticks": float(len(loop)),
        "missed": float(loop["missed"][-1]),
        "missed_at_work": float(at_work["missed"][-1] - at_work["missed"][0]),
    }


def beside(loop: Rows, control: NDArray[np.int64], rate: float) -> Figures:
    """How late the control was, rows (deadline, lateness) [ns], while the loop ran; and how many of
    the missed ticks the computer took from both: the control, too, was late by a period, which
    leaves no time for a tick.
    """
    period = round(NS / rate)
    stamps = loop["stamp"].astype(np.int64)
    control = control[(control[:, 0] >= stamps[0]) & (control[:, 0] <= stamps[-1])]
    figures = {
        f"control_{label}": float(np.quantile(control[:, 1], share)) / NS
        for label, share in QUANTILES
    }

    held = control[control[:, 1] >= period]
    missed = np.diff(loop["missed"].astype(np.int64))
    both = 0
    for after in (np.flatnonzero(missed) + 1).tolist():
        begin, end = stamps[after - 1] - period, stamps[after]
        if np.any((held[:, 0] < end) & (held[:, 0] + held[:, 1] > begin)):
            both += int(missed[after - 1])
    return figures | {"missed_by_both": float(both)}


def _used(pid: int) -> tuple[float, float]:
    """Processor time [s] and largest resident memory [bytes] of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    seconds = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    return seconds, 1024.0 * next(int(x.split()[1]) for x in lines if x.startswith("VmHWM"))
