"""Beside a reference, an alarm asks for more than the rig shows when nothing is new."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.estimator.config.settings import ConfiguredEffect, Uncertain
from gritd.tools.diagnose.fit.shape import Candidate
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import WheelRig
from gritd.tools.diagnose.screen.screen import Screen
from gritd.tools.diagnose.screen.screening import asked
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings

NULLS = np.random.default_rng(1).exponential(1.0, 300)  # the largest surprise of each


def _screen(surprise: float, habit: float, left: float) -> Screen:
    """New is a loss; what the reference shows is a slope."""
    nothing: dict[Candidate, tuple[float, float]] = {"loss": (0.0, 1.0), "slope": (0.0, 1.0)}
    screen = Screen({"loss": surprise, "slope": 0.0}, nothing, {}, {}, NULLS, open=left)
    asked = TUNING.screen.beside_reference
    return replace(screen, habit={"loss": 0.0, "slope": habit}, asked=asked)


@pytest.mark.parametrize(("surprise", "alarms"), [(19.0, False), (21.0, True)])
def test_news_surprise_twice_as_much_as_anything_in_a_run_of_the_reference(
    surprise: float, alarms: bool
) -> None:
    """A rig that is off its model in one way may be off in another where it is driven otherwise."""
    screen = _screen(surprise, habit=10.0, left=50.0)
    assert screen.alarmed == alarms
    assert (screen.p < TUNING.screen.level) == alarms


def test_a_ripple_of_the_reference_asks_for_more_of_ripples_alone() -> None:
    """A rig that ripples is off its model in nothing else."""
    screen = replace(_screen(19.0, habit=10.0, left=50.0), apart={"slope"})
    assert screen.alarmed
    raised = replace(screen, habit={"loss": 10.0, "slope": 10.0})
    assert not raised.alarmed


@pytest.mark.parametrize("left", [0.9, 1.1])
def test_what_is_new_must_stand_beside_sizes_that_suit_both_campaigns(left: float) -> None:
    screen = _screen(30.0, habit=1.0, left=left * TUNING.screen.beside_reference)
    assert screen.alarmed == (left > 1.0)
    assert (screen.p < TUNING.screen.level) == (left > 1.0)


def test_without_a_reference_slow_noise_must_be_far_less_likely() -> None:
    between = 0.5 * (TUNING.screen.beside_reference + TUNING.screen.sure)
    screen = _screen(30.0, habit=0.0, left=between)
    assert screen.alarmed
    assert not replace(screen, asked=TUNING.screen.sure).alarmed


def test_a_reference_with_transients_asks_for_more() -> None:
    """What comes with the way is never quite its model, and the new campaign drives otherwise."""
    rig = WheelRig([*record(plan(seed=3), ()), *record(plan(seed=4), ())], settings(), 3, "same")
    steady, lagging = (
        rig.having([ConfiguredEffect(name, {s: Uncertain(v, v) for s, v in strengths.items()})])
        for name, strengths in (
            ("rear_contact", {"ratio": 0.1}),
            ("contact_relaxation", {"forces": 1.0, "sinkage": 1.0, "length": 0.03}),
        )
    )
    few, many = TUNING.screen.beside_reference, TUNING.screen.sure
    assert [asked(Stack(one)) for one in (rig, steady, lagging)] == [few, few, many]


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_an_effect_is_seen_if_it_would_be_an_alarm(share: float) -> None:
    screen = _screen(0.0, habit=0.0, left=np.inf)
    most = max(screen.threshold, TUNING.screen.sure)
    screen = replace(screen, asked=TUNING.screen.sure, counts=0.5)
    assert screen.seen("loss", share * most / 0.5) == (share > 1.0)
