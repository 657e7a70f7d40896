"""Means and slopes over windows: jitter, dropped samples and single bad readings must not move what
is compared.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.offline.windows import block_bend, block_mean, block_slope, lines, members
from gritd.estimator.wheel.windows import STEP, Counters, MeanWindow

EDGES = np.arange(0.0, 5.05, 0.1)


@given(st.integers(0, 2**31), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0))
def test_a_line_stays_a_line(seed: int, offset: float, rate: float) -> None:
    """Jittered stamps with a fifth of the samples dropped: values and slopes of a line are exact
    inside.
    """
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(0.0, 5.0, 1000))[rng.random(1000) > 0.2]
    values = offset + rate * time
    middle = 0.5 * (EDGES[1:] + EDGES[:-1])
    at, slopes, _ = block_slope(time, values, EDGES)
    there = np.isfinite(slopes)
    assert there.mean() > 0.9
    np.testing.assert_allclose(at[there], (offset + rate * middle)[there], atol=1e-9)
    np.testing.assert_allclose(slopes[there], rate, atol=1e-8)
    mean = block_mean(time, values, EDGES)
    known = np.isfinite(mean)
    assert known.mean() > 0.9
    np.testing.assert_allclose(mean[known], (offset + rate * middle)[known], atol=1e-9)


def test_one_wild_reading_does_not_move_the_mean() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 5.0, 0.004)
    values = rng.normal(1.0, 0.01, time.size)
    clean = block_mean(time, values, EDGES)
    values[300] = 500.0
    np.testing.assert_allclose(block_mean(time, values, EDGES), clean, atol=0.005)


def test_a_step_within_a_block_moves_its_mean() -> None:
    """As a torque steps where a drive starts: what stands off the block's median is no bad reading,
    since its neighbours stand off too.
    """
    rng = np.random.default_rng(2)
    time = np.arange(0.0, 5.0, 0.004)
    values = np.where(time < 2.575, 0.0, 5.0) + rng.normal(0.0, 0.01, time.size)
    mean = block_mean(time, values, EDGES)
    own = (time >= EDGES[25]) & (time < EDGES[26])
    assert 0.5 < np.mean(values[own]) < 2.0
    assert mean[25] == pytest.approx(np.mean(values[own]), abs=0.3)
    assert np.isfinite(mean[1:-1]).all()


def test_a_steady_speed_is_averaged_longer_than_a_step() -> None:
    """Coarse counts at creeping speed: quiet where steady, yet a step in speed is not smeared
    beyond its neighbours.
    """
    time = np.arange(0.0, 5.0, 0.004)
    travel = np.where(time < 2.5, 0.01 * time, 0.025 + 0.02 * (time - 2.5))
    rng = np.random.default_rng(3)
    counted = np.floor(travel / 1.5e-5 + rng.random(time.size)) * 1.5e-5
    _, speed, _ = block_slope(time, counted, EDGES)
    assert np.std(speed[3:18]) < 5e-6
    assert speed[22] == pytest.approx(0.01, rel=0.01)
    assert speed[27] == pytest.approx(0.02, rel=0.01)


def test_a_short_ramp_of_a_speed_keeps_its_height() -> None:
    """Its acceleration is that of each interval, as an analogue channel's mean is."""
    time = np.arange(0.0, 5.0, 0.004)
    speed = 0.2 * np.clip((time - 2.0) / 0.5, 0.0, 1.0)
    bend = block_bend(time, np.cumsum(speed) * 0.004, EDGES)
    np.testing.assert_allclose(bend[21:24], 0.4, rtol=0.02)
    np.testing.assert_allclose(np.concatenate((bend[:19], bend[26:])), 0.0, atol=0.01)


@pytest.mark.filterwarnings("error")
def test_one_reading_a_block_tells_no_acceleration_of_its_own() -> None:
    """A slow log of a steady speed: no step is seen, and none is made of rounding."""
    time = np.arange(0.05, 5.0, 0.1)
    bend = block_bend(time, np.round(0.01 * time, 6), EDGES)
    np.testing.assert_allclose(bend[np.isfinite(bend)], 0.0, atol=1e-4)


def test_a_silence_is_not_bridged() -> None:
    time = np.concatenate([np.arange(0.0, 2.0, 0.004), np.arange(3.0, 5.0, 0.004)])
    mean = block_mean(time, np.ones(time.size), EDGES)
    assert np.isnan(mean[21:29]).all()
    assert mean[10] == pytest.approx(1.0)


def test_what_counts_leave_open_of_a_speed() -> None:
    """Speeds fitted to noisy readings of one motion scatter by what is stated of them."""
    rng = np.random.default_rng(11)
    time = np.arange(0.0, 5.0, 0.004)
    found = [
        block_slope(time, 2.0 * time + rng.normal(0.0, 1e-3, time.size), EDGES) for _ in range(200)
    ]
    off = np.array([(f.rate - 2.0) / f.sigma for f in found])
    assert np.sqrt(np.mean(off**2)) == pytest.approx(1.0, abs=0.2)


@given(st.integers(0, 2**31))
def test_windows_that_overlap_hold_what_lies_between_their_ends(seed: int) -> None:
    """Means and lines of each window, against the readings picked out one by one."""
    rng = np.random.default_rng(seed)
    stamp = np.sort(rng.choice(10_000, 60, replace=False)).astype(np.int64) * 1_000_000
    counts = np.cumsum(rng.integers(-3, 9, 60))
    until = np.sort(rng.integers(-500, 11_000, 25)).astype(np.int64) * 1_000_000
    after = until - 800_000_000

    inside = members(stamp, after, until)
    centre = (after + until) // 2
    mean, line = inside.mean(counts), lines(inside, stamp, counts, centre)
    for window, (low, high) in enumerate(zip(after, until, strict=True)):
        own = (stamp > low) & (stamp <= high)
        assert inside.size[window] == own.sum()
        if own.sum() > 1:
            rate, middle = np.polyfit((stamp[own] - centre[window]) * 1e-9, counts[own], 1)
            assert mean[window] == pytest.approx(counts[own].mean(), abs=1e-9)
            assert line.middle[window] == pytest.approx(middle, rel=1e-6, abs=1e-6)
            assert line.rate[window] == pytest.approx(rate, rel=1e-6, abs=1e-6)
            assert line.spread[window] == pytest.approx(1e-9 * stamp[own].std() * own.sum() ** 0.5)
            assert line.moved[window] == abs(counts[own][-1] - counts[own][0])


def test_the_noise_of_a_window_is_that_on_line() -> None:
    """Of readings that are now and then louder than stated, in windows of a few to some dozen."""
    rng = np.random.default_rng(3)
    stamp = np.cumsum(rng.integers(1_000_000, 9_000_000, 2000))
    loud = rng.choice([1.0, 1.0, 8.0], 2000) * rng.standard_normal(2000)
    for length in (15_000_000, 90_000_000):
        mean = MeanWindow(1.0, 0, length)
        ends, found, at = np.arange(stamp[50], stamp[-1], 17_000_000), [], 0
        for end in ends.tolist():
            while at < stamp.size and stamp[at] <= end:
                mean.insert(int(stamp[at]), float(loud[at]), Counters())
                at += 1
            mean.advance(end)
            told = mean.mean()
            found.append(told.sigma if told else 0.0)
        inside = members(stamp, ends - length, ends)
        noise = inside.heard(STEP * inside.step(loud), 1.0)
        expected = np.where(inside.size > 0, noise / np.sqrt(np.maximum(inside.size, 1)), 0.0)
        np.testing.assert_allclose(found, expected, rtol=1e-12)
        assert (noise > 1.0).any()


def test_an_empty_window_has_no_reading_and_no_mean() -> None:
    nothing = members(np.array([5, 6, 7]), np.array([7, 0]), np.array([9, 4]))
    assert nothing.size.tolist() == [0, 0] and nothing.mean(np.ones(3)).tolist() == [0.0, 0.0]


def test_one_window_alone_has_no_rate_and_therefore_no_mean_at_its_centre() -> None:
    """What lies in it may be centred elsewhere, and nothing says how the value changes."""
    time = np.arange(0.0, 0.1, 0.004)
    assert np.isnan(block_mean(time, np.ones(time.size), EDGES)).all()
