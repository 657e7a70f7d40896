"""Smoothing and rates of a measured quantity, down to a single instant."""

from __future__ import annotations

import numpy as np
import pytest

from gritd.estimator.stages.history import rate_of, smoothed


def test_a_straight_line_is_not_bent_by_smoothing_and_its_rate_is_its_slope() -> None:
    time = np.arange(0.0, 3.0, 0.01)
    assert smoothed(time, 2.0 - 0.5 * time) == pytest.approx(2.0 - 0.5 * time, abs=1e-12)
    assert rate_of(time, 2.0 - 0.5 * time) == pytest.approx(-0.5, abs=1e-9)


def test_a_single_instant_is_itself_and_has_no_rate() -> None:
    assert smoothed(1.0, 7.0) == 7.0 and rate_of(1.0, 7.0) == 0.0
    assert rate_of([0.0, 1.0], [3.0, 4.0]).tolist() == [0.0, 0.0]
