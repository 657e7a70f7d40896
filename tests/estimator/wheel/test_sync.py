"""One snapshot a tick: sorted, complete, calibrated, the same however the readings travelled."""

from __future__ import annotations

import random
from dataclasses import replace
from math import isnan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gritd.estimator.messages.readings import NS, Reading
from gritd.estimator.messages.status import CHANNEL_BITS
from gritd.estimator.wheel.sync import Sync
from gritd.estimator.wheel.windows import Counters, MeanWindow, SlopeWindow
from tests.rig import SETTINGS, readings_of

MS = 1_000_000
START = 1_700_000_000 * NS


def snapshots(readings, ticks, config=SETTINGS):
    """Snapshots at ticks 4 ms apart, readings handed over in order of receipt."""
    sync, waiting, found = Sync(config), sorted(readings, key=lambda r: r.received), []
    for k in range(ticks):
        t = START + k * 4 * MS
        while waiting and waiting[0].received <= t:
            sync.push(waiting.pop(0))
        found.append(sync.snapshot(t))
    return found, sync.counters


def test_steady_motion_is_read_back_in_si_units():
    readings = readings_of(
        START, seconds=1.0, omega=0.4, speed=0.02, sinkage=0.011, current=1.7, noise=True
    )
    found, _ = snapshots(readings, 250)
    last = found[-1]
    assert last.ready and not last.stale and not last.stuck
    assert last.wheel_speed.value == pytest.approx(0.4, abs=5 * last.wheel_speed.sigma)
    assert last.carriage_speed.value == pytest.approx(0.02, abs=5 * last.carriage_speed.sigma)
    assert last.sinkage.value == pytest.approx(0.011, abs=5 * last.sinkage.sigma)
    assert last.current.value == pytest.approx(1.7, abs=5 * last.current.sigma)
    assert last.wheel_speed.sigma < 0.01 and last.carriage_speed.sigma < 0.002


def test_all_channels_describe_the_centre_of_the_window():
    """Under acceleration the mean position must be the position at `evaluated`, not now."""
    readings = readings_of(START, seconds=1.0, omega=0.4, speed=0.02)
    found, _ = snapshots(readings, 250)
    for snapshot in found[60:]:
        elapsed = (snapshot.evaluated - START) / NS
        assert snapshot.wheel_angle == pytest.approx(0.4 * elapsed, abs=3e-4)


@settings(max_examples=20)
@given(st.floats(5e-5, 5e-4), st.floats(0.0, 4.0))
def test_an_encoder_whose_clock_drifts_does_not_leap_in_position(drift, phase):
    """Readings of another clock come to lie in the next window; the way between two windows is
    that which was driven, to a tenth of the way between two readings.
    """
    speed, between = 1e5, 4 * MS  # [counts/s], [ns]
    window = SlopeWindow(0.3, 0, 100 * MS)
    places = []
    for k in range(8000):
        stamp = START + round((k * (1.0 + drift) + phase / 4.0) * between)
        window.insert(stamp, round(speed * (stamp - START) / NS), Counters())
        end = START + k * between
        window.advance(end)
        if k > 50 and k % 25 == 0:
            line = window.slope()
            places.append(line.middle - speed * (end - 50 * MS - START) / NS)
    assert max(map(abs, places)) < 0.1 * speed * between / NS


def test_sensors_that_are_louder_than_stated_are_heard():
    """Eight times the stated noise: σ is that of the readings; of quiet ones it is the stated."""
    rng = np.random.default_rng(5)
    found = {}
    for loud in (1.0, 8.0):
        mean, line = MeanWindow(2e-3, 0, 100 * MS), SlopeWindow(0.5, 0, 100 * MS)
        sigmas = []
        for k in range(3000):
            stamp = START + k * 4 * MS
            mean.insert(stamp, 1.0 + loud * 2e-3 * rng.standard_normal(), Counters())
            line.insert(stamp, round(20.0 * k + loud * 0.5 * rng.standard_normal()), Counters())
            mean.advance(stamp)
            line.advance(stamp)
            if k > 50 and k % 25 == 0:
                sigmas.append((mean.mean().sigma, line.slope().rate_sigma))
        found[loud] = np.sqrt(np.mean(np.square(sigmas), axis=0))
    assert found[1.0][0] == pytest.approx(2e-3 / 5.0, rel=0.05)
    assert found[8.0] / found[1.0] == pytest.approx((8.0, 8.0), rel=0.1)


def test_not_ready_before_a_window_has_filled():
    found, _ = snapshots(readings_of(START, seconds=0.5), 125)
    assert not found[10].ready
    assert found[-1].ready


@settings(max_examples=25)
@given(st.randoms(use_true_random=False))
def test_readings_late_within_the_horizon_change_nothing(rng):
    ordered = readings_of(START, seconds=0.6)
    shuffled = [r._replace(received=r.stamp + rng.randrange(0, 46) * MS) for r in ordered]
    want, _ = snapshots(ordered, 130)
    have, counters = snapshots(shuffled, 130)
    assert [_without_health(s) for s in have] == [_without_health(s) for s in want]
    assert counters.late == 0


@settings(max_examples=25)
@given(st.integers(0, 10**6))
def test_duplicates_are_dropped_and_counted(seed):
    rng = random.Random(seed)
    ordered = readings_of(START, seconds=0.6)
    repeated = [r for r in ordered if rng.random() < 0.3]
    copies = [r._replace(received=r.received + 1 + rng.randrange(0, 40) * MS) for r in repeated]
    want, _ = snapshots(ordered, 180)
    have, counters = snapshots(ordered + copies, 180)
    assert [_without_health(s) for s in have[:140]] == [_without_health(s) for s in want[:140]]
    assert counters.duplicates == len(copies) and counters.late == 0


def test_a_reading_older_than_the_horizon_is_counted_and_ignored():
    ordered = readings_of(START, seconds=0.6)
    late = [
        r._replace(received=r.received + 80 * MS) if index == 400 else r
        for index, r in enumerate(ordered)
    ]
    _, counters = snapshots(late, 160)
    assert counters.late == 1


def test_latency_shifts_a_channel_back_to_when_it_was_sampled():
    delayed = replace(
        SETTINGS,
        channels={
            **SETTINGS.channels,
            "wheel_encoder": replace(SETTINGS.channels["wheel_encoder"], latency=0.02),
        },
    )
    readings = [
        r._replace(stamp=r.stamp + 20 * MS, received=r.received + 20 * MS)
        if r.channel == "wheel_encoder"
        else r
        for r in readings_of(START, seconds=0.8)
    ]
    want, _ = snapshots(readings_of(START, seconds=0.8), 180)
    have, _ = snapshots(readings, 180, delayed)
    assert [s.wheel_angle for s in have[60:]] == [s.wheel_angle for s in want[60:]]


@pytest.mark.parametrize("jump", [-(2**31), -5000, 5000, 123_456, 2**40])
def test_a_counter_jump_is_rebaselined_without_a_spike(jump):
    readings = readings_of(START, seconds=1.0, omega=0.4)
    moved = [
        r._replace(value=r.value + jump)
        if r.channel == "wheel_encoder" and r.stamp > START + NS // 2
        else r
        for r in readings
    ]
    found, counters = snapshots(moved, 250)
    assert counters.jumps == 1
    assert all(abs(s.wheel_speed.value - 0.4) < 0.01 for s in found[60:])


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf"), -0.1, 5.1])
def test_an_impossible_value_goes_no_further(value):
    readings = readings_of(START, seconds=0.6, sinkage=0.011)
    bad = Reading(START + 300 * MS + 1, "sinkage_pot", value, START + 300 * MS + 1)
    found, counters = snapshots([*readings, bad], 150)
    assert counters.invalid == 1
    assert all(s.sinkage.value == pytest.approx(0.011, abs=1e-9) for s in found[60:])


def test_a_silent_channel_is_stale_within_50_ms_and_back_at_once():
    silent = [
        r
        for r in readings_of(START, seconds=1.0)
        if r.channel != "sinkage_pot" or not 400 * MS < r.stamp - START < 700 * MS
    ]
    found, _ = snapshots(silent, 250)
    bit = CHANNEL_BITS["sinkage_pot"]
    stale = [k * 4 for k, s in enumerate(found) if s.stale & bit and k > 5]
    assert 400 < stale[0] <= 456
    assert 696 <= stale[-1] <= 704


def test_a_stuck_potentiometer_is_flagged_while_the_wheel_turns_and_not_at_rest():
    bit = CHANNEL_BITS["sinkage_pot"]
    moving, _ = snapshots(
        readings_of(START, seconds=1.0, noise=True, frozen=("sinkage_pot", 0.5)), 250
    )
    first = next(k * 4 for k, s in enumerate(moving) if s.stuck & bit)
    assert 500 < first <= 950
    resting, _ = snapshots(readings_of(START, seconds=1.0, omega=0.0, speed=0.0), 250)
    assert not any(s.stuck for s in resting)


@pytest.mark.parametrize("digit, frozen", [(1.2e-3, True), (1.6e-3, False)])
def test_a_potentiometer_that_dithers_between_two_near_values_is_stuck(digit, frozen):
    """The noise stated is 2 mV."""
    rng = random.Random(3)
    readings = [
        r._replace(value=1.25 + rng.randrange(2) * digit) if r.channel == "sinkage_pot" else r
        for r in readings_of(START, seconds=1.0, noise=True)
    ]
    found, _ = snapshots(readings, 250)
    assert any(s.stuck & CHANNEL_BITS["sinkage_pot"] for s in found) == frozen


@pytest.mark.parametrize("every", [1, 12])
def test_a_quiet_sensor_of_three_values_is_not_stuck_nor_is_a_slow_one(every):
    """A tenth of the noise that is stated; every twelfth reading, which is 20 Hz."""
    rng = random.Random(3)
    readings = [
        r._replace(value=1.25 + rng.randrange(3) * 0.2e-3) if r.channel == "sinkage_pot" else r
        for number, r in enumerate(readings_of(START, seconds=1.2, noise=True))
        if r.channel != "sinkage_pot" or (number // 4) % every == 0
    ]
    silent = [r for r in readings if not (600 * MS < r.stamp - START < 690 * MS and every == 1)]
    found, _ = snapshots(silent, 300)
    assert sum(bool(s.stuck) for s in found) <= 3, "but by chance where a channel falls silent"


def test_two_jumps_within_a_window_leave_no_speed_and_the_place_goes_on():
    readings = [
        r._replace(value=r.value + 10**6 * (NS // 2 < r.stamp - START < NS // 2 + 20 * MS))
        if r.channel == "wheel_encoder"
        else r
        for r in readings_of(START, seconds=1.0, omega=0.4)
    ]
    found, counters = snapshots(readings, 250)
    unknown = [k * 4 for k, s in enumerate(found) if k > 60 and not s.ready]
    assert counters.jumps == 2
    assert 560 <= unknown[0] <= 580 and 40 <= unknown[-1] - unknown[0] <= 60
    elapsed = (found[-1].evaluated - START) / NS
    assert found[-1].wheel_angle == pytest.approx(0.4 * elapsed, abs=2e-3)
    assert all(abs(s.wheel_speed.value - 0.4) < 0.01 for s in found[60:] if s.ready)


def test_a_stuck_wheel_encoder_is_flagged_while_the_carriage_moves():
    found, _ = snapshots(
        readings_of(START, seconds=1.2, noise=True, frozen=("wheel_encoder", 0.5)), 300
    )
    first = next(k * 4 for k, s in enumerate(found) if s.stuck & CHANNEL_BITS["wheel_encoder"])
    assert first <= 950


def test_optional_sensors_are_nan_when_absent():
    found, _ = snapshots(readings_of(START, seconds=0.6), 150)
    assert (
        isnan(found[-1].load.value)
        and isnan(found[-1].drawbar_pull.value)
        and isnan(found[-1].temperature)
    )


def _without_health(snapshot):
    """The quantities and not the age of the channels, which depends on when bytes came."""
    return repr(snapshot._replace(stale=0, stuck=0))
