"""What a reference shows already: fewer columns with the same covariance, and ripples that stand
out.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gritd.estimator.effects import make
from gritd.estimator.stages.history import followed
from gritd.tools.diagnose.fit.discrepancy import joined
from gritd.tools.diagnose.fit.shared import (
    _reduced,
    rippling_columns,
    shared_columns,
    without_ripples,
)
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.proof.ours.cases import record_fully, rig_of
from tests.tools.diagnose.campaigns import plan

pytestmark = pytest.mark.long


def test_the_reduced_columns_have_the_same_covariance() -> None:
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((200, 6)) @ rng.standard_normal((6, 40))
    reduced = _reduced(3.0 * columns, columns)
    assert reduced.shape == (200, 6)
    np.testing.assert_allclose(reduced @ reduced.T, 9.0 * columns @ columns.T, atol=1e-7)


def _columns(acting: tuple[Any, ...], seed: int, seconds: float = 60.0) -> tuple[Stack, Any]:
    """Ripples of two campaigns of which nothing is new, about a prediction without ripples."""
    before, after = (plan(seed=s, seconds=seconds, standstill=False) for s in (seed, seed + 1))
    reference = record_fully(before, acting)
    stack = Stack(rig_of(after, acting, reference, "same"))
    return stack, rippling_columns(stack)


def _ripple(order: float, size: float = 0.3) -> Any:
    return make("gear_ripple", {"ripple_cos": size, "ripple_sin": 0.0, "order": order})


@pytest.mark.parametrize("order", [12.0, 90.0])  # 0.5 turns a second: 45 Hz, on a grid of 10 Hz
def test_a_ripple_of_the_reference_is_of_its_size_in_both(order: float) -> None:
    stack, columns = _columns((_ripple(order),), 5)
    torque = stack.of("torque")
    runs = {int(stack.run[np.flatnonzero(column)[0]]) for column in columns.T if column.any()}
    assert runs == set(range(6))
    loudest = np.abs(columns[torque]).max()
    assert 0.2 < loudest < 0.45


def test_a_ripple_may_have_another_phase_and_size_at_each_slip() -> None:
    """A drive yields to its gear, and with it the slip: more so where the wheel turns slowly."""
    stack, columns = _columns((_ripple(12.0),), 5)
    slip, angle = stack.covariate("slip"), stack.covariate("wheel_angle")
    held = np.abs(np.gradient(slip)) < 1e-3
    driven = np.flatnonzero(stack.of("torque") & (stack.covariate("speed") > 0.0))
    ripple = ((1.0 + slip) * np.cos(12.0 * angle + slip))[driven]

    weights = np.linalg.lstsq(columns[driven], ripple, rcond=None)[0]
    left = (ripple - columns[driven] @ weights)[held[driven]]
    assert np.std(left) < 0.03 * np.std(ripple)


def test_less_than_a_turn_shows_a_fast_ripple() -> None:
    """A quarter of a turn holds ten of 40 ripples a turn."""
    stack, columns = _columns((_ripple(40.0),), 5, seconds=14.0)
    assert max(float(np.ptp(r.covariates["wheel_angle"])) for r in stack.rig.runs) < 2.0 * np.pi
    assert np.any(columns[stack.of("torque")])


def test_noise_does_not_ripple() -> None:
    assert _columns((), 7)[1].shape[1] == 0


def test_differences_without_ripples_are_those_of_the_noise() -> None:
    """A change of slip, which no ripple is, is a few large differences."""
    stack, _ = _columns((), 7, seconds=20.0)
    rng = np.random.default_rng(1)
    angle = stack.covariate("wheel_angle")
    here = stack.of("torque") & (stack.run == 1)
    waves = [np.where(here, f(9.0 * angle), 0.0) for f in (np.cos, np.sin)]
    noise = 0.1 * rng.standard_normal(stack.size)
    late = stack.time > np.median(stack.time[here])

    residual = noise + 5.0 * waves[0] - 3.0 * waves[1] + np.where(late, 4.0, 0.0)
    calm = without_ripples(stack, residual, np.column_stack(waves))
    usual = np.median(np.abs(np.diff(noise[here])))
    assert np.median(np.abs(np.diff(residual[here]))) > 3.0 * usual
    assert abs(np.median(np.abs(np.diff(calm[here]))) / usual - 1.0) < 0.1
    np.testing.assert_array_equal(calm[~here], residual[~here])


def test_every_listed_effect_but_ripples_may_act_in_both_in_one_part() -> None:
    stack, _ = _columns((), 7, seconds=20.0)
    u = np.zeros(len(stack.rig.constants))
    shared = shared_columns(stack, u, stack.predict(u))
    assert list(shared) == ["changes", "drive", "soil", "instruments", "starts", "memory"]
    assert all(columns.shape[1] for columns in shared.values())

    drive, torque = np.abs(shared["drive"]), stack.of("torque")  # friction is in the motor's alone
    assert drive[~torque].max() < 1e-6 * drive[torque].max()
    assert np.any(shared["soil"][stack.of("drawbar_pull")])


def test_what_a_run_begins_with_is_that_runs_alone_and_fades() -> None:
    stack, _ = _columns((), 7, seconds=20.0)
    u = np.zeros(len(stack.rig.constants))
    starts = np.abs(shared_columns(stack, u, stack.predict(u))["starts"])
    assert np.all([np.unique(stack.run[column > 0.0]).size == 1 for column in starts.T])
    first = stack.of("drawbar_pull") & (stack.run == 0)
    of_pull = starts[first].max(axis=1)
    driven = of_pull[of_pull > 0.0]
    assert driven[-1] < 0.1 * driven[0]


@pytest.mark.parametrize("law", ["two lags", "mean"])
def test_other_laws_of_memory_are_nearly_a_sum_of_lags(law: str) -> None:
    """Two lags of 15 mm of the axle's way one after the other, or a mean over its last 40 mm."""
    stack, _ = _columns((), 7, seconds=20.0)
    u = np.zeros(len(stack.rig.constants))
    predicted = stack.predict(u)
    memory = shared_columns(stack, u, predicted)["memory"]
    (source,) = (s for s in stack.rig.forms if s.name == "drawbar_pull")
    way, follows = joined(stack, [w[:, 1] for w in source.ways]), np.zeros(stack.size)
    for number in range(len(stack.rig.runs)):
        own = stack.of("drawbar_pull") & (stack.run == number)
        follows[own] = (_twice if law == "two lags" else _mean)(predicted[own], way[own])

    lack = follows - np.where(stack.of("drawbar_pull"), predicted, 0.0)
    left = lack - memory @ np.linalg.lstsq(memory, lack, rcond=1e-6)[0]
    assert np.std(left) < 0.2 * np.std(lack)


def _twice(values: np.ndarray, way: np.ndarray) -> np.ndarray:
    share = -np.expm1(-np.diff(way, prepend=way[0]) / 0.015)
    return followed(followed(values, share), share)


def _mean(values: np.ndarray, way: np.ndarray) -> np.ndarray:
    total = np.concatenate(([0.0], np.cumsum(values[1:] * np.diff(way))))
    before = np.interp(way - 0.04, way, total, left=0.0)
    length = np.minimum(way - way[0], 0.04)
    return np.where(length > 0.0, (total - before) / np.maximum(length, 1e-9), values)
