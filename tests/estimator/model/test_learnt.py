"""A learnt discrepancy of form: what the forward model adds, and where it is not known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gritd.estimator.model.correction import Correction, weights_of
from gritd.estimator.model.discrepancy import CONDITIONS, conditions_of
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.model.learnt import CHANNELS
from gritd.estimator.stages.situation import CREEP, situation_of
from gritd.estimator.wheel.form import FormOnLine, Wheeling
from gritd.tools.testbed.plant import schedule
from gritd.tools.testbed.schedule import motion_of
from gritd.tools.testbed.simulation import soil_of
from tests import forms
from tests.estimator.online.rig import SETTINGS

SOIL, WHEEL = soil_of(SETTINGS), SETTINGS.wheel
MOTION = motion_of(schedule(30.0), WHEEL.radius, 10.0)
FORM = forms.form(1)


def at(correction, slip=0.3, load=60.0, speed=0.025, direction=1.0):
    """δ at one condition that is held."""
    slip, load, speed, way = (np.full(3, value) for value in (slip, load, speed, direction))
    conditions = conditions_of(slip, load, speed, way, np.arange(3.0), correction.usual)
    return correction.at(conditions, weights_of(load, speed, way, correction.usual))


def test_the_forward_model_adds_the_mean_and_nothing_else():
    before, after = (
        simulate_arrays(WHEEL, SOIL, MOTION, torque_constant=2.0, correction=correction)
        for correction in (None, Correction(FORM))
    )
    added = Correction(FORM).of(situation_of(MOTION, WHEEL))
    for number, name in enumerate(CHANNELS):
        change = getattr(after, name) - getattr(before, name)
        np.testing.assert_allclose(change, added[:, number], atol=1e-12)
        assert np.abs(change).max() > 0.0
    np.testing.assert_allclose(2.0 * (after.current - before.current), added[:, 0], atol=1e-12)


def test_a_run_after_another_is_as_if_it_were_alone():
    alone = Correction(FORM).of(situation_of(MOTION, WHEEL))
    count = len(alone)
    twice = {
        name: np.tile(np.broadcast_to(value, count), 2)
        for name, value in vars(MOTION).items()
        if value is not None and name != "run"
    }
    both = replace(MOTION, **twice, run=np.repeat([0.0, 1.0], count))
    np.testing.assert_array_equal(
        Correction(FORM).of(situation_of(both, WHEEL)), np.vstack((alone, alone))
    )


@pytest.mark.parametrize("changed", [{"load": 0.0}, {"load": 5.0}, {"speed": 0.0}])
def test_it_is_zero_outside_contact(changed):
    found = at(Correction(FORM), **changed)
    for part in found:
        assert not part.any()


def test_torque_and_pull_turn_with_the_direction_and_sinkage_does_not():
    both = replace(FORM, domain=replace(FORM.domain, travel="both"))
    weights = [
        weights_of(np.array([60.0]), np.array([0.02]), np.array([way]), Correction(both).usual)
        for way in (1.0, -1.0)
    ]
    assert weights[0].tolist() == [[1.0, 1.0, 1.0]] and weights[1].tolist() == [[-1.0, -1.0, 1.0]]


@pytest.mark.parametrize(
    "outside", [{"slip": 0.98}, {"load": 900.0}, {"speed": 1.0}, {"direction": -1.0}]
)
def test_outside_its_domain_the_variance_is_the_priors(outside):
    """And the mean nearly nought; the weight is in proportion to the load."""
    inside, beyond = at(Correction(FORM)), at(Correction(FORM), **outside)
    share = outside.get("load", 60.0) / 60.0
    for number, channel in enumerate(FORM.channels):
        whole = np.hypot(np.linalg.norm(beyond.columns[-1, number]), beyond.rest[-1, number])
        prior = channel.size * share
        assert whole == pytest.approx(prior, rel=0.25)
        assert inside.rest[-1, number] < 0.2 * channel.size < beyond.rest[-1, number] / share
        assert abs(beyond.mean[-1, number]) < 0.5 * prior


def test_far_outside_it_is_the_prior_exactly():
    far = at(Correction(FORM), load=1e5, speed=10.0, direction=-1.0)
    for number, channel in enumerate(FORM.channels):
        assert far.rest[-1, number] == pytest.approx(channel.size * 1e5 / 60.0, rel=1e-3)
        assert abs(far.mean[-1, number]) < 1e-3 * channel.size * 1e5 / 60.0


def _on_line(form, motion):
    """δ under every window of a run, one after another."""
    situation = situation_of(motion, WHEEL)
    on_line, memory, found = FormOnLine(form, WHEEL.radius), (), []
    for place in range(np.size(motion.time)):
        now = Wheeling(
            float(np.asarray(situation.slip)[place]),
            float(np.broadcast_to(motion.load, np.shape(motion.time))[place]),
            float(WHEEL.radius * np.asarray(motion.wheel_speed)[place]),
            float(np.asarray(motion.carriage_speed)[place]),
            float(np.asarray(motion.wheel_angle)[place]),
        )
        found.append(on_line.at(now, memory))
        memory = on_line.remember(now, memory)
    return found


def test_on_line_it_is_the_same_window_by_window():
    """Lags of slip and load included."""
    whole = Correction(FORM).of(situation_of(MOTION, WHEEL))
    found = [here.mean for here in _on_line(FORM, MOTION)]
    np.testing.assert_allclose(found, whole, rtol=1e-9, atol=1e-12)


def test_on_line_the_conditions_are_those_of_the_run():
    """Every lag, that of the load and what is left of the start among them."""
    situation = situation_of(MOTION, WHEEL)
    rim = WHEEL.radius * np.asarray(MOTION.wheel_speed)
    ways = np.tanh((rim + np.asarray(MOTION.carriage_speed)) / (2.0 * CREEP))
    whole = conditions_of(
        np.asarray(situation.slip),
        np.asarray(MOTION.load),
        np.abs(rim),
        ways,
        WHEEL.radius * np.asarray(MOTION.wheel_angle),
        Correction(FORM).usual,
    )
    found = [here.conditions for here in _on_line(FORM, MOTION)]
    np.testing.assert_allclose(found, whole, rtol=1e-9, atol=1e-12)


def test_conditions_tell_the_slip_100_mm_ago_and_the_start():
    """After a step of slip the longest lag has 1/e of it left 100 mm later, and the shortest none;
    of a start 1/e is left after 50 mm. Both in units of their lengths, and neither turns with the
    direction of travel.
    """
    step = 2e-4
    travel = step * np.arange(2001)  # [m]
    begins = 1000
    slip = np.where(np.arange(2001) < begins, 0.1, 0.4)
    held = np.full(2001, 60.0)
    for way in (1.0, -1.0):
        found = conditions_of(
            slip, held, held, np.full(2001, way), way * travel, Correction(FORM).usual
        )
        by_name = dict(zip(CONDITIONS, found.T, strict=True))
        later = begins + round(0.1 / step)
        longest = by_name["longest_lag"] * 0.15
        assert longest[begins - 1] == pytest.approx(0.0, abs=1e-12)
        assert longest[later] == pytest.approx(-0.3 / np.e, rel=0.01)
        assert by_name["short_lag"][later] == pytest.approx(0.0, abs=1e-9)
        start = by_name["start"] * 0.5
        assert start[0] == 1.0
        assert start[round(0.05 / step)] == pytest.approx(1.0 / np.e, rel=1e-9)


def test_a_pull_that_was_not_measured_has_no_discrepancy():
    found = at(Correction(forms.form(2, pull=False)))
    assert (
        not found.mean[:, 1].any() and not found.columns[:, 1].any() and not found.rest[:, 1].any()
    )
    assert found.mean[:, 0].any()
