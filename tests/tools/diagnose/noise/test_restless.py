"""Where what is new goes rougher than its reference, the noise is larger."""

from __future__ import annotations

import numpy as np
import pytest

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.noise.colour import Colour, Noise
from gritd.tools.diagnose.noise.estimate import restless
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings


@pytest.fixture(scope="module")
def stack() -> Stack:
    runs = record(plan(seed=3, seconds=40.0, standstill=False), ())
    return Stack(wheel_rig(runs, settings()))


def _noise(stack: Stack) -> Noise:
    colours = tuple(Colour(1.0, 1.0, 0.0) for _ in stack.rig.channels)
    nothing = np.zeros((stack.size, 0))
    return Noise(stack, colours, np.zeros(stack.size), nothing)


def _white(stack: Stack) -> Array:
    return np.random.default_rng(4).standard_normal(stack.size)


def test_a_rougher_run_is_noisier_and_the_others_are_not(stack: Stack) -> None:
    rough = stack.of("drawbar_pull") & (stack.run == 1)
    loose = restless(_noise(stack), np.where(rough, 4.0, 1.0) * _white(stack)).loose
    assert np.median(loose[rough]) == pytest.approx(4.0, rel=0.3)
    assert np.mean(loose[~rough] > 1.0) < 0.02


def test_a_slow_misfit_is_no_noise(stack: Stack) -> None:
    slow = 10.0 * np.sin(2.0 * np.pi * stack.time / 40.0)
    loose = restless(_noise(stack), slow + _white(stack)).loose
    assert np.mean(loose > 1.0) < 0.02
