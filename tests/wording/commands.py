"""What commands print of small runs."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gritd.config import packaged
from gritd.estimator.recording.topics import TICK_TOPIC
from gritd.tools.commands import demo_targets as targets
from gritd.tools.commands.diagnose_text import text
from tests.estimator.daemon.reports import publishing
from tests.tools.report import cases
from tests.wording.rig import output, said

SLIPS = (0.1, 0.3, 0.5)
TRUTH = {"cohesion": 800.0, "tan_phi": 0.6, "shear_modulus": 0.025}


def simulated(folder: Path, load: float, *more: str) -> Iterator[str]:
    """A run of 9 s at one load, `run-LOAD.mcap`."""
    segments = "".join(
        f"  - {{duration: 3 s, load: {load} N, slip: {slip}, speed: 20 mm/s}}\n" for slip in SLIPS
    )
    (folder / "schedule.yaml").write_text(f"segments:\n{segments}")
    name = f"run-{load:g}.mcap"
    yield from said(
        folder, "simulate", "--schedule", "schedule.yaml", "-o", name, "--seed", "1", *more
    )


@output
def check_config(folder: Path) -> Iterator[str]:
    for name in ("testbed.yaml", "testbed.dbc"):
        shutil.copy(packaged(name), folder / name)
    yield from said(folder, "check-config", "testbed.yaml")


@output
def one_run(folder: Path) -> Iterator[str]:
    yield from simulated(folder, 60.0)
    yield from said(folder, "info", "run-60.mcap")
    yield from said(folder, "replay", "run-60.mcap", "-o", "again.mcap")
    for name in ("testbed.yaml", "testbed.dbc"):
        shutil.copy(packaged(name), folder / name)
    yield from said(folder, "compare", "run-60.mcap", "--config", "testbed.yaml")

    (folder / "cut.mcap").write_bytes((folder / "run-60.mcap").read_bytes()[:-400])
    yield from said(folder, "info", "cut.mcap")
    yield from said(folder, "recover", "cut.mcap", "-o", "saved.mcap")


@output
def estimate(folder: Path) -> Iterator[str]:
    for load in (35.0, 60.0):
        list(simulated(folder, load))
    list(simulated(folder, 80.0, "--soil=tan_phi=0.65"))
    yield from said(folder, "estimate", "run-35.mcap", "run-60.mcap")
    yield from said(folder, "estimate", "run-35.mcap", "run-60.mcap", "run-80.mcap")


@output
def heavy_wheel(folder: Path) -> Iterator[str]:
    segment = "  - {duration: 1 s, load: 5 kN, slip: 0.2, speed: 20 mm/s}\n"
    (folder / "heavy.yaml").write_text(f"segments:\n{segment}")
    yield from said(folder, "simulate", "--schedule", "heavy.yaml", "-o", "x.mcap", "--seed", "1")


@output
def status(folder: Path) -> Iterator[str]:
    with publishing(folder / "gritd.sock"):
        yield from said(folder, "status", "--socket", "gritd.sock")
        yield from said(folder, "monitor", "--once", "--socket", "gritd.sock")
    yield from said(folder, "status", "--socket", "none.sock")


@output
def demo_judgement(folder: Path) -> Iterator[str]:
    """Within its targets, beyond them, and too short for them."""
    for seconds, cohesion in ((60.0, 830.0), (60.0, 900.0), (20.0, 2000.0)):
        judged = targets.judge(_ticks_ending(seconds, cohesion), TRUTH, "linear")
        yield from targets.table(judged)
        yield from (*(targets.reasons(judged) or [targets.praise(judged)]), "")


def _ticks_ending(seconds: float, cohesion: float) -> np.ndarray:
    """/tick of a run whose estimates begin 30 % too high."""
    count = 200
    ticks = np.zeros(count, TICK_TOPIC.codec.table_dtype)
    ticks["stamp"] = np.linspace(0, seconds * 1e9, count).astype(np.int64)
    ticks["status"] = 1
    for name, sigma in (("cohesion", 20.0), ("tan_phi", 0.01), ("shear_modulus", 0.0005)):
        ticks[name] = np.linspace(1.3, 1.0, count) * {**TRUTH, "cohesion": cohesion}[name]
        ticks[f"{name}_sigma"] = sigma
    return ticks


@output
def diagnose(folder: Path) -> Iterator[str]:
    for name in ("consistent", "explained", "several", "unlisted", "insufficient"):
        yield from (f"--- {name} ---", *text(cases.ALL[name]()).splitlines(), "")
