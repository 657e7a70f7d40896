"""Stretches in which nothing that is set changes."""

from __future__ import annotations

import numpy as np

from gritd.tools.diagnose.orders.stretches import GridMotion, stretches

TIME = np.arange(0.05, 30.0, 0.1)
DRIVEN = np.full(TIME.size, 0.3)


def _ends(load: np.ndarray) -> list[tuple[float, float]]:
    begins, ends = stretches(GridMotion(TIME, DRIVEN, DRIVEN, load))
    return [(round(float(b), 1), round(float(e), 1)) for b, e in zip(begins, ends, strict=True)]


def test_a_load_that_steps_ends_a_stretch() -> None:
    noise = 0.3 * np.random.default_rng(1).standard_normal(TIME.size)
    (first, second) = _ends(np.where(TIME < 12.0, 60.0, 90.0) + noise)
    assert first == (0.0, 11.7)
    assert second == (12.3, 30.0)


def test_a_load_that_ripples_or_is_struck_does_not() -> None:
    rng = np.random.default_rng(2)
    ripple = 60.0 + 8.0 * np.sin(4.0 * TIME) + 0.3 * rng.standard_normal(TIME.size)
    struck = (
        60.0 + np.where((TIME + 2.5) % 5.0 < 0.3, 20.0, 0.0) + 0.3 * rng.standard_normal(TIME.size)
    )
    assert _ends(ripple) == [(0.0, 30.0)]
    assert _ends(struck) == [(0.0, 30.0)]


def test_a_load_that_was_not_measured_ends_none() -> None:
    assert _ends(np.full(TIME.size, np.nan)) == [(0.0, 30.0)]
