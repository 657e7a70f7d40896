"""A ripple that the recordings show at their own rate is a mismatch by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.tools.diagnose.screen.screen import Screen


def test_a_ripple_at_full_rate_is_an_alarm_by_itself() -> None:
    quiet = Screen({"slope": 0.0}, {"slope": (0.0, 1.0)}, {}, {}, np.zeros(99), open=0.0)
    assert not quiet.alarmed and quiet.p == 1.0
    likely = replace(quiet, ripple=1e-3)
    assert not likely.alarmed and likely.p == pytest.approx(1e-3)
    sure = replace(quiet, ripple=1e-6)
    assert sure.alarmed and sure.p == pytest.approx(1e-6)
