"""What follows late, against its closed form."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gritd.tools.proof.blind.plant.memory import lagged, mean_before

LENGTHS = st.just(0.0) | st.floats(1e-5, 0.3)


def uneven(seed: int) -> np.ndarray:
    """A rising path with rests almost as long as a step."""
    return np.cumsum(np.random.default_rng(seed).uniform(1e-4, 0.02, 200))


@given(st.integers(0, 99), LENGTHS)
def test_a_lag_follows_a_ramp_at_its_length(seed: int, length: float) -> None:
    path = uneven(seed)
    late = lagged(3.0 * path, np.diff(path, prepend=path[0]), length)
    known = 3.0 * (path - length * -np.expm1(-(path - path[0]) / max(length, 1e-12)))
    np.testing.assert_allclose(late, known, atol=1e-9)


@given(st.integers(0, 99), LENGTHS)
def test_a_mean_follows_a_ramp_at_half_its_length(seed: int, length: float) -> None:
    path = uneven(seed)
    late = mean_before(3.0 * (path - path[0]), path, length)
    gone = path - path[0]
    known = np.where(gone > length, gone - 0.5 * length, 0.5 * gone**2 / max(length, 1e-12))
    np.testing.assert_allclose(late, 3.0 * np.minimum(known, gone), atol=1e-9)


@given(st.integers(0, 99), LENGTHS)
def test_both_stay_within_what_they_follow(seed: int, length: float) -> None:
    path = uneven(seed)
    values = np.random.default_rng(seed + 1).normal(size=path.size)
    for late in (
        lagged(values, np.diff(path, prepend=path[0]), length),
        mean_before(values, path, length),
    ):
        assert values.min() - 1e-9 <= late.min() and late.max() <= values.max() + 1e-9
