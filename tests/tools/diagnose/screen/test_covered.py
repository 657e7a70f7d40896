"""What a reference covers: no load far from its own, and a wheel that stands as where it drove
last.
"""

from __future__ import annotations

import numpy as np
import pytest

from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.diagnose.screen.covered import _held, covered_share
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings


def test_a_standing_wheel_is_covered_as_where_it_drove_last() -> None:
    inside = np.array([True, True, False, True, True, False, True])
    drives = np.array([False, True, True, False, False, True, False])
    assert _held(inside, drives).tolist() == [True, True, False, False, False, False, False]


def test_before_it_drives_it_is_covered() -> None:
    assert _held(np.zeros(3, bool), np.array([False, False, True])).tolist() == [True, True, False]


@pytest.mark.parametrize(("light", "share"), [(60.0, 1.0), (2.0, 0.0)])
def test_a_reference_at_a_far_lighter_load_covers_nothing(light: float, share: float) -> None:
    """Beside 60 N a wheel under 2 N hardly touches soil: it tells nothing of the form."""
    before = record(plan(seed=3, loads=(light, light, light)), ())
    after = record(plan(seed=3, loads=(60.0, 60.0, 60.0)), ())
    rig = wheel_rig([*before, *after], settings(), len(before), "same")
    assert covered_share(Stack(rig)) == pytest.approx(share, abs=0.05)
