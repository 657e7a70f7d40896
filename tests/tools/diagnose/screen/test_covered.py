"""What a reference covers: no load far from its own, and a wheel that stands as where it drove
last.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import WheelRig
from gritd.tools.diagnose.screen import screening
from gritd.tools.diagnose.screen.covered import _held, covered_share
from gritd.tools.diagnose.screen.screen import Screen
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
    rig = WheelRig([*before, *after], settings(), len(before), "same")
    assert covered_share(Stack(rig)) == pytest.approx(share, abs=0.05)


@pytest.mark.parametrize(("share", "alarms"), [(1.0, True), (0.3, False)])
def test_a_new_ripple_counts_by_the_covered_share(
    share: float, alarms: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    quiet = Screen({"loss": 0.0}, {"loss": (0.0, 1.0)}, {}, {}, np.zeros(300))
    given: Any = {
        "_screen_beside_reference": quiet, "_covered": share, "_open_form": 0.0, "_ripple": 1e-6,
        "strain_of": 0.0,
    }  # fmt: skip
    for name, value in given.items():
        monkeypatch.setattr(screening, name, lambda *_, value=value: value)

    referred = SimpleNamespace(stack=SimpleNamespace(referred=True))
    of_pair: Any = SimpleNamespace(problem=referred, base=None, surrogates=None)
    assert screening.screen_of_base(of_pair).alarmed == alarms
