"""An estimate that is not to be believed is not told."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import pytest

from gritd.estimator.config.settings import Uncertain
from gritd.estimator.filter.trust import Trust
from gritd.estimator.filter.tuning import TRUST
from gritd.estimator.messages.status import UPDATED, Flag, Status
from gritd.estimator.messages.tick import Aid
from tests.estimator.filter.rig import RIG, TRUTH, run
from tests.linear_plant import THREE_LOADS

HALF = 10.0  # components in half the memory
FINE = Aid(1.0, 1e-4, 0.01, 1e-4, 0.04, True)  # an innovation of one σ
FAR = FINE._replace(innovation=0.045)


def after(aids, windows, trust=None):
    trust = trust or Trust()
    for _ in range(windows):
        trust = trust.passed(0.1).surprised(aids, 0.1)
    return trust


def test_innovations_of_their_stated_size_are_no_disagreement():
    trust = after((FINE, FINE), 100)
    assert trust.consistency == pytest.approx(1.0)
    assert trust.standing(HALF, 0.3) == Status.TRACKING and not trust.inconsistent(HALF)


def test_the_channel_that_is_off_is_the_one_with_the_large_innovations():
    torque, drawbar_pull = after((FAR, FINE), 30).surprise
    assert torque > 10.0 * drawbar_pull
    assert after((FAR, FAR), 30).standing(HALF, 0.3) == Status.MISMATCH


def test_a_few_windows_decide_nothing():
    trust = after((FAR, FAR), 4)
    assert not trust.disagrees(HALF) and not trust.inconsistent(HALF)


def test_one_window_counts_for_so_much_at_most():
    spike = FINE._replace(innovation=1e3)
    assert after((spike,), 1).surprise[0] == TRUST.most


def test_change_after_change_is_a_disagreement():
    trust = Trust()
    for _ in range(4):
        trust = trust.passed(4.0).changed()
    assert trust.standing(HALF, 0.3) == Status.TRACKING, "a ramp of 20 s"
    for _ in range(4):
        trust = trust.passed(4.0).changed()
    assert trust.standing(HALF, 0.3) == Status.MISMATCH


def test_what_was_set_back_again_and_again_has_diverged_until_it_holds():
    trust = Trust()
    for _ in range(TRUST.diverged):
        trust = trust.reset().passed(TRUST.patience + 1.0)
    assert trust.standing(HALF, 0.3) == Status.DIVERGED and trust.doubt == TRUST.doubt**2
    trust = trust.passed(TRUST.relapse)
    assert trust.standing(HALF, 0.3) == Status.TRACKING and trust.doubt == 1.0


def test_a_posterior_wider_than_the_prior_has_diverged():
    assert Trust().standing(HALF, 1.1 * TRUST.wider) == Status.DIVERGED


def test_unrest_after_a_change_dies_down():
    assert Trust().unrest == 0.0 and Trust().since_change == inf
    unrest = [Trust().changed().passed(t).unrest for t in (0.0, 5.0, 50.0)]
    assert unrest[0] > unrest[1] > 50.0 * unrest[2] > 0.0


def reported(ticks):
    """The ticks at which the prior is reported."""
    return [t for t in ticks if t["flags"] & Flag.PRIOR]


@pytest.mark.parametrize("offset", [0.3, 0.1, -0.1, -0.3])
def test_a_torque_that_no_soil_explains_leaves_the_prior_as_the_answer(offset):
    """The amplifier's zero is off by up to 0.6 N·m that nobody stated."""
    shunt = RIG.channels["motor_shunt"]
    zero = replace(shunt.calibration, offset=Uncertain(offset))
    channels = {**RIG.channels, "motor_shunt": replace(shunt, calibration=zero)}
    _, ticks = run(replace(RIG, channels=channels), TRUTH, THREE_LOADS, plant=RIG)
    updated = [t for t in ticks if t["status"] in UPDATED]
    assert ticks[-1]["flags"] & Flag.PRIOR
    assert len(reported(updated)) > 0.5 * len(updated)
    for tick in reported(ticks):
        assert tick["cohesion"] == RIG.soil.cohesion.value
        assert tick["cohesion_sigma"] == pytest.approx(RIG.soil.cohesion.sigma)
        assert tick["tan_phi"] == RIG.soil.tan_phi.value


def test_an_honest_run_never_tells_the_prior():
    _, ticks = run(RIG, TRUTH, THREE_LOADS)
    assert not reported(ticks) and not any(t["flags"] & Flag.CHANGED for t in ticks)


def test_a_bound_that_the_prior_allows_is_an_answer():
    """Dry sand without cohesion, and a prior that knows of it."""
    settings = replace(RIG, soil=replace(RIG.soil, cohesion=Uncertain(60.0, 60.0)))
    _, ticks = run(settings, (0.0, 0.62, 0.025), THREE_LOADS)
    assert not reported(ticks) and ticks[-1]["cohesion"] < 3.0 * ticks[-1]["cohesion_sigma"]
