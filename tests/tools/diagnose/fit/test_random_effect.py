"""What the noise hides of a term is left out, and nothing else."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gritd.tools.diagnose.fit.columns import Columns, columns_of
from gritd.tools.diagnose.fit.random_effect import RandomEffect, Sizes, shown
from gritd.tools.diagnose.tuning import TUNING
from tests.tools.diagnose.fit.test_columns import sparse


def covariance(columns: Columns) -> np.ndarray:
    """(N, N) of what unit normal weights amount to."""
    return columns.dense @ columns.dense.T


@given(sparse(), st.integers(0, 3), st.sampled_from([1e-2, 0.1, 1.0, 10.0]))
def test_what_is_left_out_is_less_than_the_noise(
    columns: np.ndarray, kept: int, size: float
) -> None:
    own, kept = columns_of(columns), min(kept, columns.shape[1])
    whitened = replace(own, blocks=tuple((rows, 2.0 * block) for rows, block in own.blocks))
    term = RandomEffect("any", own, whitened, Sizes((0.0, size), (0.5, 0.5)))
    found = shown(term, kept)

    np.testing.assert_allclose(found.whitened.dense, 2.0 * found.columns.dense)
    last = found.columns.count - kept
    np.testing.assert_array_equal(
        found.columns.dense[:, last:], columns[:, len(columns.T) - kept :]
    )

    hidden = size**2 * (covariance(term.whitened) - covariance(found.whitened))
    values = np.linalg.eigvalsh(hidden)
    assert values[0] > -1e-9 * max(values[-1], 1.0)
    assert values[-1] <= TUNING.numerics.shown_least * max(len(own.blocks), 1) + 1e-9
    squares = np.sum(found.whitened.dense[:, :last] ** 2, axis=0)
    assert np.all(size**2 * squares > 0.99 * TUNING.numerics.shown_least)
