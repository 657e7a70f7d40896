"""Noise of the measured speeds is no slope along the speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.estimator.effects.base import Effect
from gritd.estimator.effects.library import make
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.problem import free_of
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.unrest import unrest_of
from gritd.tools.diagnose.rig.wheel import WheelRig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

SHARE = 0.004  # of the speed


def _moving(wheel: Array, carriage: Array) -> Motion:
    count = wheel.size
    nothing = np.zeros(count)
    return Motion(
        time=0.1 * np.arange(count),
        wheel_angle=nothing,
        wheel_speed=wheel,
        carriage_position=nothing,
        carriage_speed=carriage,
        load=nothing + 70.0,
    )


def test_unrest_is_what_a_held_speed_shows_beside_itself() -> None:
    """Not a step of the speed, nor a wheel that stands."""
    rng = np.random.default_rng(5)
    held = np.where(np.arange(400) < 200, 0.2, 0.3)
    held[:50] = 0.0
    noise = SHARE * rng.standard_normal(400)
    wheel, carriage = unrest_of(_moving(held * (1.0 + noise), 0.1 * held))
    assert not np.any(wheel[:50])
    assert np.abs(wheel).max() < 5.0 * SHARE
    np.testing.assert_allclose(wheel[85:165], noise[85:165], atol=0.5 * SHARE)
    np.testing.assert_allclose(carriage, 0.0, atol=1e-12)


def test_a_short_run_has_no_unrest() -> None:
    wheel, carriage = unrest_of(_moving(np.full(30, 0.2), np.full(30, 0.02)))
    assert not wheel.any() and not carriage.any()


def _noisy(signals: Signals, rng: np.random.Generator) -> Signals:
    """The same run, its wheel's speed measured with white noise."""
    noise = 1.0 + SHARE * rng.standard_normal(signals.time.size)
    return replace(signals, wheel_speed=signals.wheel_speed * noise)


def _noisy_rig(acting: list[Effect]) -> WheelRig:
    rng = np.random.default_rng(6)
    drawn = plan(seconds=30.0, speeds=(0.02,) * 3)
    return WheelRig([_noisy(s, rng) for s in record(drawn, acting)], settings())


def test_a_fit_knows_the_noise_of_the_wheels_speed() -> None:
    """Its columns hold both moving parts, and their weight says that the wheel's unrest is noise
    and that the carriage's is not.
    """
    base = fit_base(_noisy_rig([]), np.random.default_rng(0))
    stack = base.problem.stack
    assert stack.unrest.shape == (stack.size, 2)
    wheel, _ = base.fitted.slack[base.problem.tolerance.shape[1] - 2 :]
    assert wheel == pytest.approx(1.0, abs=0.3)


def test_friction_that_falls_with_speed_has_no_more_evidence_than_friction_at_one_speed() -> None:
    """At one speed Stribeck's curve is Coulomb's constant. Only noise of the measured speed could
    tell them apart.
    """
    base = fit_base(
        _noisy_rig([make("coulomb_friction", {"loss": 0.05})]), np.random.default_rng(0)
    )
    problem, effects = base.problem, base.problem.stack.rig.effects
    nats = {}
    for name in ("coulomb_friction", "stribeck_friction"):
        free = free_of((effects[name],))
        start = np.array([0.1, 0.0])[: len(free)]
        nats[name] = problem.descend((effects[name],), free, base.fitted.u, start).nats
    assert nats["stribeck_friction"] > nats["coulomb_friction"] - 1.0
