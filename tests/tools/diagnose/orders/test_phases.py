"""Runs whose encoders begin at other angles are aligned by a ripple."""

from __future__ import annotations

import numpy as np
import pytest

from gritd.tools.diagnose.orders.campaigns import Lines, lines_of
from gritd.tools.diagnose.orders.phases import guide, shifts
from gritd.tools.diagnose.orders.stretches import TURN, Samples
from tests.tools.diagnose.orders.made import campaign, readings

ORDER = 40.0


def _lines(zeros: list[float], size: float = 0.5) -> Lines:
    """Of runs whose encoders are off by these angles [rad]."""
    rng = np.random.default_rng(3)
    runs = []
    for zero in zeros:
        made = readings(rng, ripple=(size, 0.0, ORDER))
        runs.append(Samples(made.time, made.angle - zero / TURN, made.values, made.stretch))
    return lines_of(campaign(runs))


def test_runs_that_begin_alike_stay_as_they_are() -> None:
    assert guide(_lines([0.0, 0.0, 0.0])) is None
    assert guide(_lines([0.0, 0.0], size=0.0)) is None


def test_other_beginnings_are_told_up_to_a_tooth() -> None:
    zeros = [0.0, 0.05, -0.06]
    line = guide(_lines(zeros))
    assert line is not None and line.at == pytest.approx(ORDER, abs=0.05)
    moved = shifts(line)
    tooth = TURN / ORDER
    off = (moved - moved[0] - np.array(zeros) + 0.5 * tooth) % tooth - 0.5 * tooth
    np.testing.assert_allclose(off, 0.0, atol=0.01)
