"""What was known of the soil and what the recordings say, where they agree and where not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.tools.diagnose.explain.soil import reconciled

MEANS = st.floats(-8.0, 8.0)
SIGMAS = st.floats(0.01, 0.99)


@given(MEANS, SIGMAS)
def test_it_is_the_same_on_both_sides_and_never_surer(mean: float, sigma: float) -> None:
    value, own = reconciled(mean, sigma)
    assert reconciled(-mean, sigma) == pytest.approx((-value, own), abs=1e-6)
    assert own > 0.99 * sigma


@given(st.floats(-1.0, 1.0), st.floats(0.02, 0.95))
def test_what_agrees_stays(share: float, sigma: float) -> None:
    """Within one σ of what the recordings of such a precision usually say."""
    mean = share * np.sqrt(1.0 - sigma**2)
    value, own = reconciled(mean, sigma)
    assert abs(value - mean) < 0.2 * sigma
    assert own < 1.5 * sigma


def test_what_says_little_and_pulls_far_is_doubted() -> None:
    """Recordings twice as vague as what was known, and 15 σ away from it."""
    value, own = reconciled(-3.0, 0.9)
    assert -1.0 < value < 0.0
    assert own > 1.0


def test_what_is_told_precisely_is_believed() -> None:
    value, own = reconciled(-5.0, 0.05)
    assert value == pytest.approx(-5.0, abs=0.05)
    assert own < 0.1


@pytest.mark.parametrize("sigma", [0.0, 1e-9, 1.0, 1.2])
def test_no_measurement_and_an_exact_one_stay(sigma: float) -> None:
    assert reconciled(0.7, sigma) == (0.7, sigma)
