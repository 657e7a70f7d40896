"""Slip, θ₁ and the speed of a quantised count, with the uncertainty each states."""

from __future__ import annotations

from math import acos, cos, isfinite, isnan, nan, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.wheel.geometry import entry_angle, max_stress_angle, sinkage, slip, slope_sigma

speeds = st.floats(1e-3, 1.0)


def test_slip_has_the_textbook_values():
    assert slip(1.0, 0.8).value == pytest.approx(0.2)  # driving: (rω − v)/rω
    assert slip(0.8, 1.0).value == pytest.approx(-0.2)  # braking: (rω − v)/v
    assert slip(1.0, 0.0).value == 1.0  # spinning on the spot
    assert slip(0.0, 1.0).value == -1.0  # dragged with the brake on


@given(speeds, speeds)
def test_slip_is_bounded_and_keeps_its_sign(rim, travel):
    i = slip(rim, travel).value
    assert -1.0 <= i <= 1.0
    assert (i > 0) == (rim > travel) or abs(rim - travel) < 1e-12 * rim


@given(speeds, speeds)
def test_slip_derivatives_match_finite_differences(rim, travel):
    if abs(rim - travel) < 1e-3 * rim:
        return  # the two branches meet here
    estimate = slip(rim, travel)
    step = 1e-6 * min(rim, travel)
    by_rim = (slip(rim + step, travel).value - slip(rim - step, travel).value) / (2 * step)
    by_travel = (slip(rim, travel + step).value - slip(rim, travel - step).value) / (2 * step)
    assert estimate.d_rim == pytest.approx(by_rim, rel=1e-3, abs=1e-3)
    assert estimate.d_travel == pytest.approx(by_travel, rel=1e-3, abs=1e-3)


@given(st.floats(-1e-9, 1e-9))
def test_slip_is_continuous_through_zero(epsilon):
    assert slip(1.0, 1.0 - epsilon).value == pytest.approx(epsilon, abs=1e-15)


@given(st.floats(0.01, 1.0), st.floats(1e-9, 0.99))
def test_entry_angle_inverts_sinkage(radius, share):
    z = share * radius
    angle = entry_angle(radius, z)
    assert sinkage(radius, angle.value) == pytest.approx(z, rel=1e-6)
    assert angle.value == pytest.approx(acos(1 - z / radius), rel=1e-12)


@given(st.floats(0.01, 1.0), st.floats(1e-4, 0.99))
def test_entry_angle_derivative(radius, share):
    z, step = share * radius, 1e-7 * radius
    slope = (entry_angle(radius, z + step).value - entry_angle(radius, z - step).value) / (2 * step)
    assert entry_angle(radius, z).d_sinkage == pytest.approx(slope, rel=1e-3)


@given(st.floats(allow_nan=False, allow_infinity=False, min_value=-10, max_value=10))
def test_entry_angle_is_finite_for_any_sinkage(z):
    angle = entry_angle(0.07, z)
    assert 0.0 <= angle.value <= acos(0.0) and isfinite(angle.d_sinkage)
    assert z > 0.0 or angle.value == 0.0


@given(st.floats(-1, 1), st.floats(0, 1.5), st.floats(0, 1), st.floats(-1, 1))
def test_max_stress_angle_stays_inside_the_contact(i, theta_1, c1, c2):
    assert 0.0 <= max_stress_angle(c1, c2, i, theta_1) <= theta_1


def test_max_stress_angle_is_half_of_entry_by_default():
    assert max_stress_angle(0.5, 0.0, 0.3, 0.8) == 0.4
    assert cos(max_stress_angle(0.5, 0.2, 0.5, 0.8)) == pytest.approx(cos(0.48))


@pytest.mark.parametrize("rate", [0.0, 3.0, 10.0, 30.0, 100.0, 307.0, 1013.0, 3037.0])
def test_stated_speed_error_covers_quantisation(rate):
    """Root mean square of error/σ over random phases stays at or below 1.3, at any speed."""
    rng = np.random.default_rng(3)
    t = np.arange(25) * 0.004
    centred = t - t.mean()
    spread = sqrt(centred @ centred)
    squares = []
    for _ in range(2000):
        true = rate * rng.uniform(0.9, 1.1)
        counts = np.floor(rng.uniform() + true * t)
        error = centred @ counts / spread**2 - true
        squares.append(
            (error / slope_sigma(sqrt(1 / 12), spread, 25, abs(counts[-1] - counts[0]))) ** 2
        )
    assert sqrt(np.mean(squares)) < 1.3


def test_slip_of_what_is_not_known_or_hardly_moves_is_no_error():
    """A silent wheel encoder beside a carriage at rest gives NaN and 0; squares of tiny speeds
    underflow.
    """
    assert all(isnan(value) for value in slip(nan, 0.0))
    assert all(isnan(value) for value in slip(1.0, nan))
    assert slip(1e-200, 1e-170) == (0.0, 0.0, 0.0) == slip(0.0, -0.0)
