"""Columns that stand for a covariance may be combined, and what the noise hides left out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from gritd.tools.diagnose.fit.random_effect import blocks_shown, shown

N = 60
WHITE = cast(Any, SimpleNamespace(whitener=sparse.identity(N, format="csr"), touched=slice))


def test_combined_columns_have_the_same_covariance() -> None:
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((200, 6)) @ rng.standard_normal((6, 40))
    reduced = shown(3.0 * columns, columns, 0.3)
    assert reduced.shape == (200, 6)
    np.testing.assert_allclose(reduced @ reduced.T, 9.0 * columns @ columns.T, atol=1e-7)


@given(st.integers(0, 999), st.integers(0, N), st.floats(1e-4, 10.0))
def test_what_is_left_out_is_less_than_the_noise(seed: int, end: int, size: float) -> None:
    """And no column reaches to values where none of those that it combines does."""
    columns = size * np.random.default_rng(seed).standard_normal((N, 9))
    columns[end:, 4:] = 0.0
    kept = blocks_shown(columns, WHITE)
    left = columns @ columns.T - kept @ kept.T
    assert -1e-9 < np.linalg.eigvalsh(left).max() < 0.01
    assert kept.shape[1] <= 9
    assert kept[end:].any(axis=0).sum() <= 4
