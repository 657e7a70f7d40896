"""The spelled-out closed forms of one sample are those of `linear`."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.terramechanics import linear, scalar
from gritd.estimator.terramechanics.integrals import Integrals
from gritd.estimator.terramechanics.soil import Wheel

conditions = st.tuples(
    st.floats(0.0, 5000.0),  # c
    st.floats(0.05, 1.5),  # tan φ
    st.floats(2e-3, 0.2),  # k
    st.floats(1e-4, 1.5),  # θ₁
    st.floats(-0.2, 1.0),  # i
    st.floats(5.0, 300.0),  # W
)


STEPS = np.array(
    [300.0, 0.1, 0.1, 0.1, 0.1, 10.0, 0.1, 0.1]
)  # a change of each variable that matters


def changes(prediction):
    """T, DP and resistance, each with what a step of every variable makes of it, shape (3, 7)."""
    return np.column_stack([prediction[:3], np.array(prediction[4:]) * STEPS])


@pytest.mark.parametrize("wheel", [Wheel(0.072, 0.071), Wheel(0.125, 0.16, 0.43, 0.32)])
@pytest.mark.parametrize("shifted", [False, True])
@given(condition=conditions, seed=st.integers(0, 1000))
def test_values_and_gradients_are_those_of_the_linear_model(wheel, shifted, condition, seed):
    drawn = np.random.default_rng(seed).uniform(-0.02, 0.02, (6, 8)).tolist()
    shift = linear.Shift(*[Integrals(*row) for row in drawn]) if shifted else None
    have, want = (
        scalar.predict(wheel, *condition, shift),
        linear.predict(wheel, *condition, shift=shift),
    )
    size = np.abs(changes(want)).max(axis=1, keepdims=True)
    assert np.all(np.abs(changes(have) - changes(want)) <= 1e-10 * size)
    assert have.sigma_m == pytest.approx(want.sigma_m, rel=1e-10)


@pytest.mark.parametrize("edge", [(0.0, 0.3), (0.6, 0.0), (0.6, -0.3), (1e-9, 0.5)])
def test_where_digits_would_be_lost_the_linear_model_answers(edge):
    theta_1, slip = edge
    args = (Wheel(0.072, 0.071, 0.4, 0.2), 800.0, 0.6, 0.2, theta_1, slip, 70.0)
    assert scalar.predict(*args) == linear.predict(*args)
