"""A wheel that stands has the sinkage of where it drove last: it is known where that is."""

from __future__ import annotations

import numpy as np

from gritd.tools.diagnose.screen.covered import _held


def test_a_standing_wheel_is_covered_as_where_it_drove_last() -> None:
    inside = np.array([True, True, False, True, True, False, True])
    drives = np.array([False, True, True, False, False, True, False])
    assert _held(inside, drives).tolist() == [True, True, False, False, False, False, False]


def test_before_it_drives_it_is_covered() -> None:
    assert _held(np.zeros(3, bool), np.array([False, False, True])).tolist() == [True, True, False]
