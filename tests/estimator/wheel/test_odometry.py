"""Slip over several windows is what one regression over all their readings gives."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.messages.readings import NS
from gritd.estimator.wheel.odometry import of_window

LENGTH = 0.1  # [s] of a window
READINGS = 50  # in a window
NOISE = 1e-5  # [m]


def readings(windows, seed=0, noise=NOISE):
    """Times (n,) [s], and the ways of rim and carriage (n,) [m] in so many windows."""
    rng = np.random.default_rng(seed)
    time = (np.arange(windows * READINGS) + 0.5) * LENGTH / READINGS
    rim, travel = 0.04 * time + 3.0, 0.03 * time - 1.0
    return time, *[way + noise * rng.standard_normal(time.size) for way in (rim, travel)]


def slope(time, way):
    return np.polyfit(time, way, 1)[0]


def of_readings(time, rim, travel, undone=(0.0, 0.0)):
    """One window each."""
    parts = []
    for t, a, b in zip(
        *[np.split(each, time.size // READINGS) for each in (time, rim, travel)], strict=True
    ):
        speeds = (slope(t, a), slope(t, b))
        at = round(t.mean() * NS) + 1_700_000_000 * NS
        parts.append(of_window(at, LENGTH, (a.mean(), b.mean()), speeds, undone))
    return parts


def all_of(parts):
    first, *others = parts
    for part in others:
        first = first.joined(part)
    return first


@given(st.integers(1, 12), st.integers(0, 11))
def test_consecutive_windows_are_one_regression(windows, cut):
    time, rim, travel = readings(windows)
    parts = of_readings(time, rim, travel)
    whole = all_of(parts)
    assert whole.slopes[:2] == pytest.approx((slope(time, rim), slope(time, travel)), rel=1e-5)
    assert whole.slopes[2] == pytest.approx(1.0 / windows)

    # in whatever portions they are joined
    if 0 < cut < windows:
        portions = all_of(parts[:cut]).joined(all_of(parts[cut:]))
        assert portions.slopes[:2] == pytest.approx(whole.slopes[:2], rel=1e-9)
        assert portions.slopes[2] == pytest.approx(whole.slopes[2])


def test_what_lies_between_windows_that_do_not_follow_each_other_says_nothing():
    parts = of_readings(*readings(6))
    moved = [part._replace(piece=part.piece._replace(rim=part.piece.rim + 1.0)) for part in parts]
    gap = all_of([parts[0], parts[1], *moved[4:]])  # the wheel turned on unseen
    assert gap.slopes[0] == pytest.approx(0.04, rel=1e-2)
    assert gap.slopes[2] == pytest.approx(0.5)


@given(st.integers(1, 9), st.integers(1, 9))
def test_windows_at_two_slips_give_their_mean(one, other):
    """As torque and drawbar pull are means."""
    time, rim, travel = readings(one + other, noise=0.0)
    parts = of_readings(time, rim, travel)
    later = of_readings(time, 1.5 * rim, travel)[one:]
    apart = [part._replace(at=part.at + NS) for part in later]  # a second, unseen, between them
    whole = all_of(parts[:one]).joined(all_of(apart))
    expected = 0.04 * (one + 1.5 * other) / (one + other)
    assert whole.slopes[:2] == pytest.approx((expected, 0.03), rel=1e-5)


def test_sigma_is_narrowed_by_as_much_as_the_error_is():
    windows, errors = 5, []
    alone = slope(*readings(1, noise=0.0)[:2])
    for seed in range(400):
        time, rim, travel = readings(windows, seed)
        parts = of_readings(time, rim, travel)
        mean = np.mean([part.slopes[0] for part in parts])
        errors.append((mean - alone, all_of(parts).slopes[0] - alone))

    of_mean, of_whole = np.std(errors, axis=0)
    assert of_whole / of_mean == pytest.approx(all_of(parts).slopes[2], rel=0.15)


def test_what_effects_add_to_the_speeds_is_kept():
    parts = of_readings(*readings(4, noise=0.0), undone=(0.001, -0.002))
    assert all_of(parts).slopes[:2] == pytest.approx((0.041, 0.028))
