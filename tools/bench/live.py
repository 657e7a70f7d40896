"""The daemon at work: `gritd run` as a process of its own against the simulated testbed on
pseudo-terminals. When the first estimate comes, how late its ticks are, what it takes of a core and
of memory.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np

from gritd.config import packaged
from gritd.estimator.recording.cdr import Rows
from gritd.estimator.recording.salvage import read
from gritd.estimator.threads.stop_request import StopRequest
from gritd.tools.cli.child import Child

READY = 120.0  # [s] the longest that the testbed or a device may take
# [s] for which the testbed plays before the command, so that the wheel drives steadily, and after
BEFORE, SPARE = 2.0, 10.0
QUANTILES = (("median", 0.5), ("at_99_percent", 0.99), ("at_99.9_percent", 0.999), ("worst", 1.0))

Figures = dict[str, float]


def live(seconds: float, folder: Path, configuration: Path | None = None) -> Figures:
    """Times in s of the wall clock, beginning with the command; memory in bytes.

    folder: of the run; configuration: of the testbed, else the packaged one.
    """
    folder.mkdir()
    stop = StopRequest()
    told = ["--seconds", str(BEFORE + seconds + SPARE), "--folder", str(folder), "--wait"]
    told += ["--can", "slcan", "--config", str(configuration or packaged())]

    with Child(stop, "testbed", "gritd.tools.testbed.testbed", *told) as testbed:
        config = testbed.wait_for("configuration ", READY).split(" ", 1)[1]
        testbed.tell("play")
        time.sleep(BEFORE)
        began, clock = time.time(), time.monotonic()
        with Child(stop, "daemon", "gritd", "run", "--config", config, "--name", "live") as daemon:
            while time.monotonic() - clock < seconds:
                daemon.line(0.2)
            used, memory = _used(daemon.pid)
            elapsed = time.monotonic() - clock
            daemon.stop()

    recording = read(next(folder.glob("*.mcap")))
    return {
        **_started(recording.arrays("/tick"), began),
        "memory": memory,
        "share_of_a_core": used / elapsed,
        **_punctual(recording.arrays("/loop")),
    }


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
    return figures | {"ticks": float(len(loop)), "missed": float(loop["missed"][-1])}


def _used(pid: int) -> tuple[float, float]:
    """Processor time [s] and largest resident memory [bytes] of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    seconds = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    return seconds, 1024.0 * next(int(x.split()[1]) for x in lines if x.startswith("VmHWM"))
