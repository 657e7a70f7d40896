"""Noise of the measured speeds is no slope along the speed."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import norm

from gritd.estimator.effects.base import Effect
from gritd.estimator.effects.library import make
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.base import BaseFit
from gritd.tools.diagnose.fit.model import fit_model
from gritd.tools.diagnose.fit.problem import Free, Maker, free_of
from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.motion_error import unrest_of
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

pytestmark = pytest.mark.long

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


def test_a_speed_that_is_never_held_has_no_unrest() -> None:
    swinging = 0.2 + 0.05 * np.sin(0.3 * np.arange(400))
    wheel, _ = unrest_of(_moving(swinging, 0.02 + 0.0 * swinging))
    assert not wheel.any()


def test_a_short_run_has_no_unrest() -> None:
    wheel, carriage = unrest_of(_moving(np.full(30, 0.2), np.full(30, 0.02)))
    assert not wheel.any() and not carriage.any()


def _noisy(signals: Signals, rng: np.random.Generator) -> Signals:
    """The same run, its wheel's speed measured with white noise."""
    noise = 1.0 + SHARE * rng.standard_normal(signals.time.size)
    return replace(signals, wheel_speed=signals.wheel_speed * noise)


def _noisy_rig(acting: list[Effect]) -> Rig:
    rng = np.random.default_rng(6)
    drawn = plan(seconds=30.0, speeds=(0.02,) * 3)
    return wheel_rig([_noisy(s, rng) for s in record(drawn, acting)], settings())


def test_a_fit_knows_the_noise_of_the_wheels_speed() -> None:
    """Its columns hold both moving parts, and their weight says that the wheel's unrest is noise
    and that the carriage's is not.
    """
    base = fit_base(_noisy_rig([]))
    stack = base.problem.stack
    assert stack.nuisances.shape == (stack.size, 2)
    wheel, _ = base.fitted.slack[base.problem.nuisance.count - 2 :]
    assert wheel == pytest.approx(1.0, abs=0.3)


def _evidence(base: BaseFit, effect: Maker, free: tuple[Free, ...]) -> float:
    start = np.array([0.1, 0.0])[: len(free)]
    none = tuple(0 for _ in base.forms)
    model = fit_model(base.problem, base.forms, (effect,), free, (base.fitted.u, start), none)
    assert model.fitted.converged
    return model.evidence


@pytest.fixture(scope="module")
def rubbing() -> BaseFit:
    """The base fit of a rig whose drive loses 0.05 N·m, driven at one speed, without its starts."""
    rig = _noisy_rig([make("coulomb_friction", {"loss": 0.05})])
    runs = []
    for run in rig.runs:
        speed = run.covariates["speed"]
        held = (speed == 0.0) | (np.abs(speed / 0.02 - 1.0) < 0.1)
        runs.append(replace(run, used={**run.used, "torque": run.used["torque"] & held}))
    return fit_base(replace(rig, runs=tuple(runs)))


def test_friction_that_falls_with_speed_has_no_more_evidence_than_friction_at_one_speed(
    rubbing: BaseFit,
) -> None:
    """At one speed Stribeck's curve is Coulomb's constant. Only noise of the measured speed could
    tell them apart.
    """
    effects = rubbing.problem.stack.rig.effects
    coulomb, stribeck = (
        _evidence(rubbing, effect, free_of((effect,)))
        for effect in (effects["coulomb_friction"], effects["stribeck_friction"])
    )
    assert stribeck < coulomb + 1.0


def test_evidence_along_a_ridge_is_that_of_a_sum_over_its_shape(rubbing: BaseFit) -> None:
    """At one speed the strength of Stribeck's curve and the speed at which it falls are one: the
    optimum is a curved ridge. Laplace's formula in both is held against a sum over the speed, each
    fitted by itself.
    """
    effect = rubbing.problem.stack.rig.effects["stribeck_friction"]
    strength, speed = free_of((effect,))
    known = speed.parameter
    step = 0.6
    places = [x for x in np.arange(-1.2, 4.2, step) if speed.value(x) > known.low]

    held = []
    for x in places:
        maker = partial(effect, **{known.name: speed.value(x)})
        maker.name = effect.name  # type: ignore[attr-defined]
        held.append(_evidence(rubbing, maker, (replace(strength, effect=maker),)))
    prior = step * norm.pdf(places)
    total = float(logsumexp(held, b=prior))
    assert _evidence(rubbing, effect, (strength, speed)) == pytest.approx(total, abs=1.5)
