"""Waiting is counted in looks, not by the clock."""

from __future__ import annotations

import pytest

from gritd.estimator.threads import waiting


def test_patience_counts_looks_not_the_time_in_which_it_was_held_up(monkeypatch):
    looks = []
    monkeypatch.setattr(waiting.time, "sleep", looks.append)
    assert (
        waiting.wait_until(lambda: False, 1.0) == 0.0
        and len(looks) == 100
        and sum(looks) == pytest.approx(1.0)
    )
    looks.clear()
    assert waiting.wait_until(lambda: len(looks) == 25, 1.0) == pytest.approx(0.75)
    assert (
        waiting.wait_until(lambda: True, 1.0) == 1.0
        and waiting.wait_until(lambda: True, 0.0) == 0.0
    )
