"""Downsampled curves: nothing that stands out is lost, whatever the curve."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gritd.tools.view.downsample import envelope


@given(st.integers(0, 2**32), st.integers(2, 300), st.integers(1, 40), st.floats(0.0, 1.0))
def test_least_and_greatest_are_kept_and_time_ascends(seed, count, half, missing) -> None:
    random = np.random.default_rng(seed)
    steps, values = random.exponential(size=count) + 1e-6, random.standard_cauchy(count)
    values[random.random(count) < missing] = np.nan
    time = np.cumsum(steps)
    column = values[:, None]
    span = (float(time[0]), float(np.nextafter(time[-1], np.inf)))
    shown, curves = envelope(time, np.hstack((column, -column)), span, 2 * half)

    assert len(shown) == len(curves) <= max(len(time), 2 * half)
    assert (np.diff(shown) > 0.0).all()
    if np.isfinite(column).any():
        for at, sign in enumerate((1.0, -1.0)):
            kept = curves[:, at]
            assert np.nanmin(kept) == np.nanmin(sign * column)
            assert np.nanmax(kept) == np.nanmax(sign * column)


def test_a_gap_stays_a_gap() -> None:
    time = np.concatenate((np.arange(0.0, 10.0, 0.01), np.arange(20.0, 30.0, 0.01)))
    shown, curves = envelope(time, np.ones((len(time), 1)), (0.0, 30.0), 60)
    assert np.isnan(curves[(shown > 10.5) & (shown < 19.5)]).all()
    assert np.isfinite(curves[(shown < 9.5) | (shown > 20.5)]).all()


def test_what_is_short_enough_comes_as_it_is_with_a_sample_on_either_side() -> None:
    time = np.arange(100.0)
    shown, curves = envelope(time, time[:, None], (50.5, 60.5), 50)
    assert shown.tolist() == list(range(50, 62)) and curves[:, 0].tolist() == shown.tolist()
