"""What a reference shows already: fewer columns with the same covariance, and ripples that stand
out.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gritd.estimator.effects import make
from gritd.tools.diagnose.fit.shared import (
    _reduced,
    rippling_columns,
    shared_columns,
    without_ripples,
)
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

pytestmark = pytest.mark.long


def test_the_reduced_columns_have_the_same_covariance() -> None:
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((200, 6)) @ rng.standard_normal((6, 40))
    reduced = _reduced(3.0 * columns, columns)
    assert reduced.shape == (200, 6)
    np.testing.assert_allclose(reduced @ reduced.T, 9.0 * columns @ columns.T, atol=1e-7)


def _columns(acting: tuple[Any, ...], seed: int, seconds: float = 60.0) -> tuple[Stack, Any]:
    """Ripples of two campaigns of which nothing is new, about a prediction without ripples."""
    before, after = (
        record(plan(seed=s, seconds=seconds, standstill=False), acting) for s in (seed, seed + 1)
    )
    stack = Stack(wheel_rig([*before, *after], settings(), len(before), "same"))
    smooth = Stack(
        wheel_rig(
            [*record(plan(seed=seed, seconds=seconds, standstill=False), ())] * 2,
            settings(),
            3,
            "same",
        )
    )
    residual = stack.measured - smooth.measured
    return stack, rippling_columns(stack, residual)


def test_a_ripple_of_the_reference_is_of_its_size_in_both() -> None:
    ripple = make("gear_ripple", {"ripple_cos": 0.3, "ripple_sin": 0.0, "order": 12.0})
    stack, columns = _columns((ripple,), 5)
    torque = stack.of("torque")
    runs = {int(stack.run[np.flatnonzero(column)[0]]) for column in columns.T if column.any()}
    assert runs == set(range(6))
    loudest = np.abs(columns[torque]).max()
    assert 0.2 < loudest < 0.45


def test_a_ripple_faster_than_the_grid_keeps_its_size() -> None:
    """0.5 turns a second and 90 ripples a turn are 45 Hz; the grid has 10 Hz."""
    ripple = make("gear_ripple", {"ripple_cos": 0.6, "ripple_sin": 0.0, "order": 90.0})
    stack, columns = _columns((ripple,), 5)
    torque = stack.of("torque")
    assert columns.shape[1]
    assert 0.0 < np.abs(columns[torque]).max() < 0.6


def test_less_than_a_turn_shows_a_fast_ripple() -> None:
    """A quarter of a turn holds ten of 40 ripples a turn."""
    ripple = make("gear_ripple", {"ripple_cos": 0.3, "ripple_sin": 0.0, "order": 40.0})
    stack, columns = _columns((ripple,), 5, seconds=14.0)
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
    assert list(shared) == ["changes", "drive", "soil", "instruments"]
    assert all(columns.shape[1] for columns in shared.values())

    drive, torque = np.abs(shared["drive"]), stack.of("torque")  # friction is in the motor's alone
    assert drive[~torque].max() < 1e-6 * drive[torque].max()
    assert np.any(shared["soil"][stack.of("drawbar_pull")])
