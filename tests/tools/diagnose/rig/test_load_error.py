"""Noise of a measured load is no physics of the wheel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.tools.diagnose.method import fit_base
from gritd.tools.diagnose.rig.motion_error import changes_of, error_of_level
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.screen.screening import prepare_screening
from gritd.tools.diagnose.search.search import begin
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

pytestmark = pytest.mark.long

LEVEL = 40.0  # [N]


def _slow_noise(size: float, rng: np.random.Generator, count: int) -> np.ndarray:
    """Correlated over 2 s on a grid of 10 Hz."""
    keep, values, now = float(np.exp(-0.05)), [], float(rng.standard_normal())
    for kick in np.sqrt(1.0 - keep**2) * rng.standard_normal(count):
        now = keep * now + float(kick)
        values.append(size * now)
    return np.array(values)


def test_changes_of_a_load_are_quick_ones_and_slow_ones_about_the_runs_level() -> None:
    time = 0.1 * np.arange(600)
    slow = 0.05 * np.sin(2.0 * np.pi * time / 30.0)
    quick = 0.01 * np.random.default_rng(1).standard_normal(time.size)
    told_quick, told_slow = changes_of(LEVEL * np.exp(slow + quick))
    np.testing.assert_allclose(told_slow[40:-40], slow[40:-40], atol=0.012)
    np.testing.assert_allclose(told_quick[40:-40], quick[40:-40], atol=0.012)


def test_other_weights_and_a_lifted_wheel_are_no_noise() -> None:
    load = np.repeat((0.0, LEVEL, 2.0 * LEVEL, LEVEL), (100, 200, 100, 200))
    for part in changes_of(load):
        assert not part.any()


def test_the_error_of_a_mean_load_counts_the_colour_of_its_noise() -> None:
    """Ten times what white noise of this size would leave, and about what slow noise does."""
    rng = np.random.default_rng(2)
    runs = [LEVEL + _slow_noise(1.0, rng, 400) for _ in range(200)]
    shown = float(np.median([error_of_level(run) for run in runs]))
    true = float(np.std([run.mean() for run in runs])) / LEVEL
    assert shown == pytest.approx(true, rel=0.3)
    assert error_of_level(runs[0][:5]) == 0.0


def _weighed(signals: Signals, noise: float, rng: np.random.Generator) -> Signals:
    """The same run that does not state its weights, its load measured with slow noise [N]."""
    load = signals.analogue["load"] + _slow_noise(noise, rng, signals.time.size)
    info = replace(signals.info, nominal_load=None)
    return replace(signals, info=info, analogue={**signals.analogue, "load": load})


@pytest.mark.parametrize(("noise", "seed"), [(1.5, 3), (1.5, 4), (1.5, 5), (3.0, 3)])
def test_slow_noise_of_the_measured_load_raises_no_alarm(noise: float, seed: int) -> None:
    """Noise [N] of 8 % of the smallest load, for which each seed alarms without the errors of the
    load, and once of 15 %.
    """
    rng = np.random.default_rng(seed)
    runs = [_weighed(s, noise, rng) for s in record(plan(loads=(20.0, 35.0, 100.0)), [])]
    rig = wheel_rig(runs, settings())
    assert "load" not in rig.channels

    base = fit_base(rig)
    assert not begin(prepare_screening(base)).first.alarmed
