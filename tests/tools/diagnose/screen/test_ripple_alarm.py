"""What is an alarm by itself: a ripple at the recordings' own rate, a constant beyond belief."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gritd.tools.diagnose.screen.evidence import Pass
from gritd.tools.diagnose.screen.screening import Screen

QUIET = Screen(Pass(0.0, {}), {}, 0.0, False, 1.0, 0.0)


def test_a_ripple_at_full_rate_is_an_alarm_by_itself() -> None:
    assert not QUIET.alarmed and QUIET.p == 1.0
    likely = replace(QUIET, ripple=1e-3)
    assert not likely.alarmed and likely.p == pytest.approx(1e-3)
    sure = replace(QUIET, ripple=1e-6)
    assert sure.alarmed and sure.p == pytest.approx(1e-6)


@pytest.mark.parametrize(("strain", "alarms"), [(3.4, False), (4.5, True)])
def test_beyond_four_sigma_nothing_is_consistent(strain: float, alarms: bool) -> None:
    shown = replace(QUIET, strain=strain)
    assert shown.alarmed == alarms and (shown.p < 0.01) == alarms


@pytest.mark.parametrize(("evidence", "alarms"), [(4.0, False), (8.0, True)])
def test_an_explanation_that_is_a_hundred_times_likelier_is_an_alarm(
    evidence: float, alarms: bool
) -> None:
    assert replace(QUIET, exact=-evidence).alarmed == alarms
