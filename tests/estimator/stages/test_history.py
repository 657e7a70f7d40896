"""Smoothing and rates of a measured quantity, down to a single instant."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.stages.history import (
    presliding,
    rate_of,
    run_by_run,
    smoothed,
    turned_round,
)


def test_a_straight_line_is_not_bent_by_smoothing_and_its_rate_is_its_slope() -> None:
    time = np.arange(0.0, 3.0, 0.01)
    assert smoothed(time, 2.0 - 0.5 * time) == pytest.approx(2.0 - 0.5 * time, abs=1e-12)
    assert rate_of(time, 2.0 - 0.5 * time) == pytest.approx(-0.5, abs=1e-9)


def test_a_single_instant_is_itself_and_has_no_rate() -> None:
    assert smoothed(1.0, 7.0) == 7.0 and rate_of(1.0, 7.0) == 0.0
    assert rate_of([0.0, 1.0], [3.0, 4.0]).tolist() == [0.0, 0.0]


STATES, STEPS = st.floats(-1.0, 1.0), st.floats(-4.0, 4.0)


@given(STATES, STEPS, st.floats(0.0, 3.0))
def test_presliding_in_two_steps_is_one(state: float, moved: float, exponent: float) -> None:
    halfway = turned_round(state, 0.5 * moved, exponent)
    once = turned_round(state, moved, exponent)
    assert turned_round(halfway, 0.5 * moved, exponent) == pytest.approx(once, abs=1e-9)
    assert -1.0 <= once <= 1.0


@given(STATES, STEPS)
def test_presliding_has_a_spring_and_an_exponential_as_limits(state: float, moved: float) -> None:
    spring = min(max(state + moved, -1.0), 1.0)
    assert turned_round(state, moved, 0.0) == pytest.approx(spring, abs=1e-12)
    slowly = np.sign(moved) + (state - np.sign(moved)) * np.exp(-abs(moved))
    assert turned_round(state, moved, 1.0) == pytest.approx(slowly, abs=1e-12)


@pytest.mark.parametrize("exponent", [0.3, 0.7, 1.5, 2.5])
def test_presliding_solves_its_equation(exponent: float) -> None:
    """Against steps of Euler's method along a path there and back."""
    travel = 3e-4
    path = 1e-3 * np.sin(np.linspace(0.0, 7.0, 200_001))
    moved, s = np.diff(path, prepend=path[:1]) / travel, 1.0
    stepped = []
    for x in moved.tolist():
        s += x * max(1.0 - s * np.sign(x), 0.0) ** exponent
        stepped.append(s)
    assert np.allclose(presliding(path, travel, exponent), stepped, atol=2e-4)


@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.0, 2.0])
def test_presliding_of_what_is_not_known_or_endless(exponent: float) -> None:
    """A prediction that runs away must not end a diagnosis."""
    assert np.isnan(turned_round(0.3, np.nan, exponent))
    assert np.isnan(turned_round(np.nan, 0.1, exponent))
    assert turned_round(1.0, -np.inf, exponent) == -1.0
    with np.errstate(invalid="ignore"):
        assert np.isnan(presliding(np.array([0.0, np.inf, np.inf]), 1e-4, exponent)[-1])


@given(st.lists(st.integers(1, 9), min_size=1, max_size=5), st.integers(0, 2**32 - 1))
def test_each_run_is_taken_by_itself(counts: list[int], seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=sum(counts))
    run = np.repeat(np.arange(len(counts), dtype=float), counts)
    apart = np.split(values, np.cumsum(counts)[:-1])
    expected = np.concatenate([np.cumsum(part) for part in apart])
    np.testing.assert_array_equal(run_by_run(np.cumsum, run, values), expected)
    np.testing.assert_array_equal(run_by_run(np.cumsum, 3.0, values), np.cumsum(values))
