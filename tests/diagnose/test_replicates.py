"""Runs of one condition, one after the other: what they differ by, in their means and in how they wander."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tools.diagnose import replicates
from tools.diagnose.noise import Colour

RUNS, VALUES, STEP = 6, 200, 0.1
NOISE = Colour(0.01, 1.0, 0.5, 0.0)


def stack_of(slip: float = 0.2) -> Any:
    """Six runs of one channel, every one at the same slip, speed and load."""
    time = np.tile(STEP * np.arange(VALUES), RUNS)
    run = np.repeat(np.arange(RUNS), VALUES)
    gaps = np.where(time == 0.0, np.inf, STEP)
    held = {"slip": slip + 1e-3 * np.sin(time), "speed": np.full(time.size, 0.02), "load": np.full(time.size, 70.0)}
    runs = [SimpleNamespace(covariates={**held, "position": np.zeros(1), "pass": np.ones(1)}) for _ in range(RUNS)]
    rig = SimpleNamespace(channels=("sinkage",), runs=runs)
    return SimpleNamespace(
        rig=rig, size=time.size, time=time, run=run, gaps=gaps, channel=np.zeros(time.size, dtype=int),
        covariate=held.__getitem__,
    )  # fmt: skip


def wandering(stack: Any, mean: float, drift: float, seed: int = 0) -> Any:
    """Slow noise, and of each run an offset and a slope of its own."""
    rng = np.random.default_rng(seed)
    out = rng.normal(0.0, np.sqrt(0.5) * NOISE.sigma, stack.size)
    along = 2.0 * stack.time / stack.time.max() - 1.0
    for run in range(RUNS):
        own = stack.run == run
        slow = np.zeros(VALUES)
        for n in range(1, VALUES):
            slow[n] = np.exp(-STEP) * slow[n - 1] + np.sqrt(1.0 - np.exp(-2.0 * STEP)) * rng.normal()
        out[own] += np.sqrt(0.5) * NOISE.sigma * slow + rng.normal(0.0, mean) + rng.normal(0.0, drift) * along[own]
    return out


def test_noise_alone_makes_no_drift() -> None:
    stack = stack_of()
    found = [replicates.between_runs(stack, wandering(stack, 0.0, 0.0, seed), (NOISE,))[0] for seed in range(40)]
    assert np.mean([spread[1:].any() for spread in found]) < 0.15
    assert np.median([spread.max() for spread in found]) < 0.5 * NOISE.sigma


def test_means_and_drifts_of_their_own_are_found() -> None:
    stack = stack_of()
    found = np.array([replicates.between_runs(stack, wandering(stack, 0.2, 0.3, s), (NOISE,))[0] for s in range(20)])
    assert np.median(found[:, 0]) == pytest.approx(0.2, rel=0.3)
    assert np.median(found[:, 1][found[:, 1] > 0.0]) == pytest.approx(0.3, rel=0.3)
    assert np.median(found[:, 2]) < 0.02


def test_what_was_held_does_not_fall_on_an_edge() -> None:
    """70 % slip is 17.5 cells of 4 %: half of the values on either side, were the edges where they fall."""
    assert len(np.unique(replicates.cells(stack_of(0.7)))) == 1


def test_each_run_may_wander_for_itself() -> None:
    stack = stack_of()
    columns = replicates.run_columns(stack, np.array([[0.2, 0.3, 0.0, 0.0]]))
    assert columns.shape == (stack.size, 2 * RUNS)
    first = columns[stack.run == 0]
    assert np.ptp(first[:, 0]) == 0.0 and first[0, 1] == pytest.approx(-0.3) and first[-1, 1] == pytest.approx(0.3)
    assert not first[:, 2:].any()
