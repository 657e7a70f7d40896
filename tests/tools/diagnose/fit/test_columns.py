"""Columns in blocks behave as the matrix that they stand for."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gritd.tools.diagnose.fit.columns import Columns, columns_of, joined, whole


@st.composite
def sparse(draw: st.DrawFn) -> np.ndarray:
    """(11, m), each column nought outside of some consecutive values."""
    rng = np.random.default_rng(draw(st.integers(0, 999)))
    columns = rng.standard_normal((11, draw(st.integers(0, 6))))
    for column in columns.T:
        first, last = sorted(draw(st.tuples(st.integers(0, 11), st.integers(0, 11))))
        column[:first] = column[last:] = 0.0
    return columns


def matrix(columns: Columns) -> np.ndarray:
    return columns.times(np.zeros(columns.count))[:, None] + columns.dense


@given(sparse(), sparse(), st.integers(0, 10), st.integers(1, 11))
def test_blocks_are_the_matrix(one: np.ndarray, other: np.ndarray, begin: int, end: int) -> None:
    a, b = columns_of(one), joined(11, (whole(other), columns_of(other)))
    both = np.hstack((other, other))
    np.testing.assert_array_equal(matrix(a), one)
    np.testing.assert_array_equal(matrix(b), both)
    np.testing.assert_allclose(a.products(b), one.T @ both, atol=1e-12)

    weights = np.arange(both.shape[1], dtype=float)
    np.testing.assert_allclose(b.times(weights), both @ weights, atol=1e-12)
    np.testing.assert_allclose(matrix(b.scaled(weights)), both * weights, atol=1e-12)

    marked = np.arange(11) % 3 > 0
    np.testing.assert_allclose(matrix(b.of_rows(marked)), both * marked[:, None], atol=1e-12)
    np.testing.assert_array_equal(matrix(b.among(marked)), both[marked])
    np.testing.assert_allclose(b.among(marked).gram, both[marked].T @ both[marked], atol=1e-12)
    values = np.random.default_rng(1).standard_normal((max(end - begin, 0), 2))
    expected = both[begin : begin + len(values)].T @ values
    np.testing.assert_allclose(b.pulled(values, begin), expected, atol=1e-12)
