"""Which weights a run was driven with: as it states, as the configuration states, or as the sensor
tells.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.tools.diagnose.rig.weights import felt, weights_in, weights_of

SETTINGS = config.load(packaged()).settings
NOMINAL = SETTINGS.load.nominal.value
TIME = np.arange(0.0, 20.0, 0.1)


def run(measured: float, stated: float | None) -> Any:
    load = measured + np.random.default_rng(1).normal(0.0, 0.1, TIME.size)
    return SimpleNamespace(
        time=TIME,
        analogue={"load": load},
        info=SimpleNamespace(nominal_load=stated, steady_states=False),
        wheel_speed=np.append(0.0, np.full(TIME.size - 1, 0.2)),
        carriage_rate=np.full(TIME.size, 0.2),
        wheel_angle=0.2 * TIME,
    )


def test_a_run_that_states_its_weights_keeps_them_beside_a_sensor_that_reads_otherwise() -> None:
    weights = weights_of(run(1.06 * NOMINAL, NOMINAL), SETTINGS)
    assert weights.known and weights.values == pytest.approx(NOMINAL)


def test_a_run_that_states_nothing_has_the_configured_weights_where_the_sensor_agrees() -> None:
    weights = weights_of(run(NOMINAL + 0.5, None), SETTINGS)
    assert weights.known and weights.values == pytest.approx(NOMINAL)


def test_a_run_that_states_nothing_and_had_others_is_taken_at_the_sensors_word() -> None:
    weights = weights_of(run(0.9 * NOMINAL, None), SETTINGS)
    assert not weights.known and weights.values == pytest.approx(0.9 * NOMINAL, rel=2e-3)


def test_a_lifted_wheel_is_no_contradiction() -> None:
    lifted = run(NOMINAL, NOMINAL)
    lifted.analogue["load"][:50] = 0.0
    weights = weights_of(lifted, SETTINGS)
    assert weights.known and weights.values[10] == 0.0 and weights.values[-1] == NOMINAL


def test_where_one_run_tells_no_weights_the_sensor_tells_those_of_all() -> None:
    shown = weights_in([run(1.06 * NOMINAL, NOMINAL), run(0.7 * NOMINAL, None)], SETTINGS)
    assert [one.known for one in shown] == [False, False]
    assert shown[0].values == pytest.approx(1.06 * NOMINAL, rel=5e-3)


def test_stated_weights_stay_where_all_runs_state_theirs() -> None:
    shown = weights_in([run(NOMINAL, NOMINAL), run(0.7 * NOMINAL, 0.7 * NOMINAL)], SETTINGS)
    assert all(one.known for one in shown)


def test_a_sensor_that_was_silent_for_most_of_a_run_does_not_tell_its_weights() -> None:
    silent = run(0.98 * NOMINAL, NOMINAL)
    silent.analogue["load"][3:] = np.nan
    shown = weights_in([silent, run(0.7 * NOMINAL, None)], SETTINGS)
    assert shown[0].values == pytest.approx(NOMINAL) and shown[0].load is None


def test_what_the_wheel_feels_follows_a_friction_that_turns_round() -> None:
    """A load that steps by twice the friction, within what may pass for one set of weights."""
    true = np.where(TIME < 10.0, 59.0, 61.0)
    load = true + np.random.default_rng(2).normal(0.0, 0.1, TIME.size)
    values, sigma = felt(TIME, load)
    far = np.abs(TIME - 10.0) > 1.0
    assert np.sqrt(np.mean((values - true)[far] ** 2)) < 0.05  # of noise of 0.1
    assert np.abs(values - true).max() < 0.5
    assert np.mean(np.abs(values - true) < 3.0 * sigma) > 0.97


def test_the_noise_that_is_left_of_a_steady_load_is_told() -> None:
    """Means over five seconds, as independent errors of the told size would make them scatter."""
    steady = 60.0 + np.random.default_rng(4).normal(0.0, 0.1, 20000)
    values, sigma = felt(0.1 * np.arange(20000), steady)
    scatter = np.std((values - 60.0).reshape(-1, 50).mean(axis=1))
    shown = np.median(sigma) / np.sqrt(50)
    assert np.std(values - 60.0) < 0.4 * 0.1
    assert 0.85 < scatter / shown < 1.15


def test_the_rounding_of_a_load_in_steps_of_its_sensor_is_told() -> None:
    true = 60.0 + 1.5 * np.sin(0.3 * TIME)
    values, sigma = felt(TIME, np.round(true))
    assert np.mean(np.abs(values - true) < 2.0 * sigma) > 0.95


def test_the_loads_of_a_table_of_steady_states_are_the_means_of_its_rows() -> None:
    """Rows of ten values with silences between them; each has its own load, and scatter."""
    table = run(NOMINAL, None)
    table.info.steady_states = True
    row = np.arange(TIME.size) // 20
    rows = np.random.default_rng(3).uniform(20.0, 120.0, row.max() + 1)[row]
    table.analogue["load"] = rows + np.random.default_rng(4).normal(0.0, 4.0, TIME.size)
    table.wheel_speed[np.arange(TIME.size) % 20 >= 10] = np.nan

    shown = weights_of(table, SETTINGS)
    known = np.isfinite(table.wheel_speed)
    assert np.abs(shown.values - rows)[known].max() < 5.0
    assert len(np.unique(shown.values[known])) == row.max() + 1
    assert np.mean(np.abs(shown.values - rows)[known] < 4.0 * np.asarray(shown.sigma)[known]) > 0.9
