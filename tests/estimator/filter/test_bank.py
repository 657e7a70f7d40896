"""Sizes of the error of form are weighed by what they foretold, and what is said of the soil is as
wide as the record leaves it.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.filter import form_error
from gritd.estimator.filter.bank import leading, misfit, reported, weights
from gritd.estimator.filter.estimate import made
from gritd.estimator.filter.tuning import FORM
from gritd.estimator.messages.status import Flag
from gritd.estimator.terramechanics.soil import Wheel
from tests.estimator.filter.rig import RIG, TRUTH, run
from tests.linear_plant import THREE_LOADS

WHEEL = Wheel(0.072, 0.071)


def bank(*evidence):
    sizes = (0.1, 0.2, 0.4, 0.8)
    pairs = zip(sizes, evidence, strict=True)
    return tuple([made((1.0, 0.6, -3.7), size * np.eye(3), log) for size, log in pairs])


def test_without_evidence_all_sizes_are_as_probable_as_before_the_run():
    assert weights(bank(5.0, 5.0, 5.0, 5.0)) == pytest.approx(FORM.odds)


def test_evidence_for_exact_equations_narrows_and_against_them_widens():
    exact, sensors = bank(50.0, 0.0, 0.0, 0.0), bank(0.0, 50.0, 0.0, 0.0)
    nothing, wrong = bank(0.0, 0.0, 0.0, 0.0), bank(0.0, 0.0, 50.0, 0.0)
    widths = [reported(each).soil_P[0][0] for each in (exact, sensors, nothing, wrong)]
    assert widths == sorted(widths)
    assert widths[0] == pytest.approx(0.1) and widths[3] == pytest.approx(0.8)
    assert misfit(exact) < 1e-9 and misfit(sensors) < 1e-9 and misfit(wrong) > 1.0 - 1e-9
    assert leading(wrong) == 2


@given(st.floats(-0.5, 1.2), st.floats(0.0, 1e4))
def test_an_error_of_form_is_an_average_of_its_nodes(slip, load):
    shares = form_error.shares(WHEEL, slip, load)
    assert len(shares) == form_error.NODES and min(shares) >= 0.0
    assert sum(shares) == pytest.approx(1.0)


def test_the_error_of_form_is_of_size_one_before_the_run():
    prior = form_error.prior()
    assert np.linalg.eigvalsh(prior)[0] > 0.0
    assert np.diag(prior) == pytest.approx(np.ones(form_error.NODES))


def test_a_plant_that_obeys_the_equations_is_not_said_to_miss_them():
    track, ticks = run(RIG, TRUTH, THREE_LOADS)
    assert misfit(track.bank) < 0.5
    assert not any(tick["flags"] & Flag.MISMATCH for tick in ticks)
