"""Where the torque is the motor's alone, its noise is the current's."""

from __future__ import annotations

import numpy as np
import pytest

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.noise.colour import Colour, Noise
from gritd.tools.diagnose.noise.estimate import calmer
from gritd.tools.diagnose.noise.saturated import Explainable
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

SLOW = Colour(1.0, 2.0, 0.99)  # time in s
QUIET = 0.3  # of the channel's noise


def _slow(stack: Stack, rng: np.random.Generator) -> Array:
    """Noise (N,) of unit size and of the colour SLOW."""
    kept = np.exp(-stack.gaps / SLOW.time)
    values, state = np.zeros(stack.size), 0.0
    for number, (keep, kick) in enumerate(zip(kept, rng.standard_normal(stack.size), strict=True)):
        state = keep * state + np.sqrt(1.0 - keep * keep) * kick
        values[number] = state
    white = rng.standard_normal(stack.size)
    return np.asarray(np.sqrt(SLOW.slow) * values + np.sqrt(1.0 - SLOW.slow) * white)


def test_slow_noise_of_an_idle_motor_is_not_taken_for_less() -> None:
    """Its values are too few to tell that their noise is slow."""
    stack = Stack(wheel_rig(record(plan(), ()), settings()))
    own = stack.of("torque")
    assert stack.idle.any()
    nothing = np.zeros((stack.size, 0))
    noise = Noise(stack, (SLOW,) * len(stack.rig.channels), np.zeros(stack.size), nothing)
    trends = np.column_stack((np.ones(stack.size), stack.time, stack.time**2)) * own[:, None]

    found = []
    for seed in range(12):
        residual = np.where(stack.idle, QUIET, 1.0) * _slow(stack, np.random.default_rng(seed))
        cells = np.full(stack.size, -1, dtype=np.intp)
        mean = Explainable(trends, nothing)
        calm = calmer(noise, residual, mean, cells, noise, stack.idle)
        found.append(float(np.median(calm.loose[stack.idle])))
    assert np.median(found) == pytest.approx(QUIET, rel=0.4)
    assert min(found) > 0.3 * QUIET
