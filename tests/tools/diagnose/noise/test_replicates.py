"""Runs of one condition, one after the other: what they differ by, in means and drifts, is no
physics.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gritd.estimator.effects import make
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.method import diagnose
from gritd.tools.diagnose.noise import replicates
from gritd.tools.diagnose.noise.colour import Colour
from gritd.tools.diagnose.rig.constants import UNITS
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import RATE, Plan, record
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of
from tests.tools.diagnose.campaigns import group, plan, settings

RUNS, VALUES, STEP = 6, 200, 0.1
NOISE = Colour(0.01, 1.0, 0.5, 0.0)


def stack_of(slip: float = 0.2) -> Any:
    """Six runs of one channel, every one at the same slip, speed and load."""
    time = np.tile(STEP * np.arange(VALUES), RUNS)
    run = np.repeat(np.arange(RUNS), VALUES)
    gaps = np.where(time == 0.0, np.inf, STEP)
    held = {
        "slip": slip + 1e-3 * np.sin(time),
        "speed": np.full(time.size, 0.02),
        "load": np.full(time.size, 70.0),
    }
    runs = [
        SimpleNamespace(covariates={**held, "position": np.zeros(1), "pass": np.ones(1)})
        for _ in range(RUNS)
    ]
    rig = SimpleNamespace(channels=("sinkage",), runs=runs, new=[True] * RUNS, units=UNITS)
    return SimpleNamespace(
        rig=rig,
        size=time.size,
        time=time,
        run=run,
        new=np.ones(time.size, bool),
        gaps=gaps,
        channel=np.zeros(time.size, dtype=int),
        covariate=held.__getitem__,
        of=lambda _: np.ones(time.size, bool),
    )


def wandering(stack: Any, mean: float, drift: float, seed: int = 0) -> Array:
    """Slow noise, and of each run an offset and a slope of its own."""
    rng = np.random.default_rng(seed)
    out = rng.normal(0.0, np.sqrt(0.5) * NOISE.sigma, stack.size)
    along = 2.0 * stack.time / stack.time.max() - 1.0
    for run in range(RUNS):
        own = stack.run == run
        slow = np.zeros(VALUES)
        for n in range(1, VALUES):
            slow[n] = (
                np.exp(-STEP) * slow[n - 1] + np.sqrt(1.0 - np.exp(-2.0 * STEP)) * rng.normal()
            )
        out[own] += (
            np.sqrt(0.5) * NOISE.sigma * slow
            + rng.normal(0.0, mean)
            + rng.normal(0.0, drift) * along[own]
        )
    return np.asarray(out)


def own(stack: Any, residual: Array) -> Array:
    """Root mean square (m,) of what a run may do for itself: offset and drifts; one column of each
    kind.
    """
    found = replicates.own_columns(stack, residual, (NOISE,))
    return np.asarray(np.sqrt(np.mean(found[stack.run == 0] ** 2, axis=0)))


def test_noise_alone_makes_no_drift() -> None:
    stack = stack_of()
    found = [
        replicates.own_columns(stack, wandering(stack, 0.0, 0.0, seed), (NOISE,))
        for seed in range(40)
    ]
    assert np.mean([columns.shape[1] > RUNS for columns in found]) < 0.15
    assert max(float(np.abs(columns).max(initial=0.0)) for columns in found) < 2.0 * NOISE.sigma


def test_means_and_drifts_of_their_own_are_found() -> None:
    stack = stack_of()
    sizes = [np.sort(own(stack, wandering(stack, 0.2, 0.3, seed)))[-2:] for seed in range(20)]
    mean, drift = (
        0.2 * np.sqrt(5 / 3),
        0.3 * np.sqrt(5 / 9),
    )  # Student's t of five differences; r.m.s. of a slope
    assert np.median(sizes, axis=0) == pytest.approx(sorted((mean, drift)), rel=0.35)


def test_what_replicates_share_stays_to_be_explained() -> None:
    """A drift that comes again in every run is physics of the condition."""
    stack = stack_of()
    shared = 0.3 * np.exp(-stack.time / 5.0)
    assert np.all(own(stack, wandering(stack, 0.0, 0.0) + shared) < NOISE.sigma)


def test_what_was_held_does_not_fall_on_an_edge() -> None:
    """70 % slip is 17.5 cells of 4 %: half of the values on either side, were the edges where they
    fall.
    """
    assert len(np.unique(replicates.cells(stack_of(0.7)))) == 1


# ---- whole diagnoses of campaigns that repeat a condition ----------------------------------------


def repeated(slow: float = 0.0, seed: int = 1) -> Plan:
    """Two conditions, each held in three runs, one after the other."""
    drawn = plan(slow=slow, slow_time=3.0, seed=seed)
    motions = []
    for number in range(RUNS):
        slip, load = ((0.15, 60.0), (0.45, 60.0))[number // 3]
        held = Schedule((Segment(2.0, load, slip, 0.0), Segment(16.0, load, slip, 0.02)), 0.5)
        motion = motion_of(held, settings().wheel.radius, RATE)
        motions.append(replace(motion, time=np.asarray(motion.time) + 40.0 * number))
    return replace(
        drawn, motions=tuple(motions), weights=(60.0,) * RUNS, weight_errors=(0.0,) * RUNS
    )


def drifting(signals: list[Signals], size: float) -> list[Signals]:
    """The bed tilted another way in every run: the potentiometer drifts by up to `size` [m]."""
    tilts = size * np.array([-1.0, 0.2, 0.7, -0.6, 1.0, -0.1])
    out = []
    for one, tilt in zip(signals, tilts, strict=True):
        drift = tilt * (one.time - one.time[0]) / np.ptp(one.time)
        out.append(
            replace(one, analogue={**one.analogue, "sinkage": one.analogue["sinkage"] + drift})
        )
    return out


def found_in(drawn: Plan, effect: tuple[Any, ...] = (), drift: float = 0.0) -> Diagnosis:
    return diagnose(wheel_rig(drifting(list(record(drawn, effect)), drift), drawn.settings))


@pytest.mark.long
@pytest.mark.parametrize(("slow", "drift"), [(0.0, 0.0), (0.5, 0.0), (0.0, 3e-3), (0.3, 3e-3)])
def test_runs_that_drift_for_themselves_are_no_alarm(slow: float, drift: float) -> None:
    found = found_in(repeated(slow), drift=drift)
    assert found.verdict in ("consistent", "insufficient"), found.summary


@pytest.mark.long
@pytest.mark.parametrize("drift", [0.0, 3e-3])
@pytest.mark.parametrize(
    "effect",
    [
        make("drying_cohesion", {"change": 2.0, "duration": 60.0}),
        make("coulomb_friction", {"loss": 0.3}),
    ],
    ids=lambda e: str(e.name),
)
def test_an_effect_is_found_beside_them(effect: Any, drift: float) -> None:
    found = found_in(repeated(), (effect,), drift)
    assert found.verdict == "explained" and effect.name in group(found), found.summary
