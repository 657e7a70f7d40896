"""Schedules that `gritd prove` does not draw, with nothing left out: sweeps, many short runs, one
long run, many equal ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.scenarios.commands import CONFIG, in_process

pytestmark = pytest.mark.long

Stretch = tuple[float, float, float, float]  # duration [s], load [N], slip, speed [m/s]
Run = tuple[Sequence[Stretch], float]  # and its ramps [s]
LOADS, SLIPS, SPEEDS = (40.0, 70.0, 100.0), (0.05, 0.15, 0.3, 0.45, 0.6), (0.01, 0.02, 0.03)


def simulated(place: Path, seed: int, stretches: Sequence[Stretch], ramp: float) -> Path:
    """One run."""
    each = "{{duration: {} s, load: {} N, slip: {}, speed: {} m/s}}"
    lines = [f"ramp: {ramp} s", "segments:", *(f"  - {each.format(*s)}" for s in stretches)]
    schedule, file = place / f"{seed}.yaml", place / f"{seed}.mcap"
    schedule.write_text("\n".join(lines), encoding="utf-8")
    assert in_process("simulate", "--schedule", schedule, "--seed", seed, "-o", file)[0] == 0
    return file


def of_slip() -> Iterator[Run]:
    """Slip swept up and down under six loads."""
    for load in (30.0, 50.0, 70.0, 90.0, 110.0, 60.0):
        yield [(30.0, load, 0.02, 0.02), (30.0, load, 0.6, 0.02), (0.5, load, 0.02, 0.02)], 29.9


def of_load() -> Iterator[Run]:
    """Load swept up and down at six slips."""
    for slip in (*SLIPS, 0.2):
        yield [(30.0, 30.0, slip, 0.02), (30.0, 110.0, slip, 0.02), (0.5, 30.0, slip, 0.02)], 29.9


def short() -> Iterator[Run]:
    """Forty runs of nine seconds."""
    rng = np.random.default_rng(2)
    for _ in range(40):
        load, slip = float(rng.choice(LOADS)), round(float(rng.uniform(0.02, 0.6)), 3)
        yield [(2.0, load, 0.1, 0.0), (7.0, load, slip, 0.02)], 0.5


def long() -> Iterator[Run]:
    """One run of twenty minutes."""
    rng = np.random.default_rng(1)
    chosen = [[float(rng.choice(of)) for of in (LOADS, SLIPS, SPEEDS)] for _ in range(48)]
    yield [(round(float(rng.uniform(10.0, 40.0)), 1), *each) for each in chosen], 1.0


@pytest.mark.parametrize("runs", [of_slip, of_load, short, long])
def test_no_schedule_gives_an_alarm(runs: Callable[[], Iterator[Run]], tmp_path: Path) -> None:
    files = [simulated(tmp_path, seed, *run) for seed, run in enumerate(runs())]
    assert consistent(files)


def test_many_equal_runs_give_no_alarm(tmp_path: Path) -> None:
    """Together so long that a value is a mean over 0.4 s, in which load and slip change."""
    files = [tmp_path / f"{seed}.mcap" for seed in range(24)]
    for seed, file in enumerate(files):
        assert in_process("simulate", "--seed", seed, "-o", file)[0] == 0
    assert consistent(files)


def consistent(files: Sequence[Path]) -> bool:
    code, said = in_process("diagnose", *files, *CONFIG)
    return code == 0 and any(line.startswith("verdict: consistent") for line in said)
