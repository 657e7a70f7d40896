"""The device clock: delays of the way do not become errors of the stamps, and so not of the speed."""

from __future__ import annotations

import random
from statistics import mean, pstdev

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.drivers.device_clock import DeviceClock, hull_slope
from tests.drivers.rig import FUZZ

NS = 1_000_000_000
EPOCH = 1_700_000_000 * NS
START_US = (1 << 32) - 5_000_000  # the clock wraps five seconds into each test


def device_us(t: float, ppm: float = 0.0) -> int:
    return (START_US + int(t * (1e6 + ppm))) % (1 << 32)


def jittery(seconds, jitter, ppm, rate=250.0, seed=1):
    """Single frames, each held back by a random delay of up to `jitter` [s]: (sample times, receive
    time) each.
    """
    rng = random.Random(seed)
    latest = 0.0
    for k in range(int(seconds * rate)):
        latest = max(latest, k / rate + 1e-4 + rng.uniform(0.0, jitter))
        yield [k / rate], latest


def batched(seconds, period, ppm, rate=250.0, seed=1):
    """Frames as a USB adapter sends them: all of one period together, then up to 0.2 ms later."""
    rng = random.Random(seed)
    waiting, flush = [], period
    for k in range(int(seconds * rate)):
        sample = k / rate + rng.uniform(0.0, 1e-5)
        if sample >= flush:
            if waiting:
                yield waiting, flush + rng.uniform(0.0, 2e-4)
            waiting, flush = [], (int(sample / period) + 1) * period
        waiting.append(sample)


def run(source, ppm):
    """Errors of the stamps [s] and delays of the frames [s] after the first ten seconds."""
    clock = DeviceClock()
    errors, delays = [], []
    for times, received in source:
        stamps = clock.stamps([device_us(t, ppm) for t in times], EPOCH + int(received * NS))
        assert all(stamp <= EPOCH + int(received * NS) for stamp in stamps)
        if times[0] > 10.0:
            errors += [(stamp - EPOCH) / NS - t for stamp, t in zip(stamps, times, strict=True)]
            delays += [received - t for t in times]
    return errors, delays


@pytest.mark.parametrize("ppm", [-100.0, 0.0, 100.0])
@pytest.mark.parametrize(
    "source",
    [
        lambda p: jittery(40, 4e-3, p),
        lambda p: batched(40, 15.97e-3, p),
        lambda p: batched(40, 1.013e-3, p),
    ],
)
def test_stamps_are_far_better_than_the_delays(source, ppm):
    errors, delays = run(source(ppm), ppm)
    assert pstdev(errors) < pstdev(delays) / 20
    assert max(errors) - min(errors) < max(delays) / 10


@pytest.mark.parametrize("ppm", [-100.0, 100.0])
def test_speed_over_the_window_is_right_to_a_thousandth(ppm):
    errors, _ = run(batched(40, 15.97e-3, ppm), ppm)
    window = 25  # 100 ms at 250 Hz
    speed_errors = [(b - a) / 0.1 for a, b in zip(errors, errors[window:], strict=False)]
    assert max(map(abs, speed_errors)) < 1e-3
    assert abs(mean(speed_errors)) < 2e-6


def test_stamps_grow_with_the_device_time():
    clock = DeviceClock()
    last = 0
    for times, received in jittery(20, 8e-3, 50.0):
        (stamp,) = clock.stamps([device_us(times[0], 50.0)], EPOCH + int(received * NS))
        assert stamp > last
        last = stamp


def test_an_adapter_that_gets_quicker_makes_no_sample_jump():
    """Chunks of 16 ms come 7 ms earlier than all before: the line is pushed down, below what was
    stamped already.
    """
    clock, last, gaps = DeviceClock(), None, []
    for number in range(200):
        times = [0.016 * number + 0.001 * k for k in range(16)]
        received = 0.016 * (number + 1) + (0.008 if number < 100 else 0.001)
        for stamp in clock.stamps([device_us(t) for t in times], EPOCH + int(received * NS)):
            gaps += [] if last is None else [stamp - last]
            last = stamp
    assert min(gaps) > 0.5e6 and max(gaps) < 1.1e6  # of 1 ms


def test_samples_of_one_instant_get_one_stamp():
    clock = DeviceClock()
    assert len(set(clock.stamps([1000, 1000, 1000], EPOCH))) == 1


def test_frames_of_the_first_chunk_keep_their_distances():
    assert DeviceClock().stamps([1000, 5000, 9000], EPOCH) == [
        EPOCH - 8_000_000,
        EPOCH - 4_000_000,
        EPOCH,
    ]


def steady(clock, seconds, at=0.0, device_start=0):
    """Feed frames without delay; the last stamp's error [ns]."""
    for k in range(round(seconds * 100)):
        received = EPOCH + int(at * NS) + k * NS // 100
        (stamp,) = clock.stamps([(device_start + k * 10_000) % (1 << 32)], received)
    return stamp - received


@pytest.mark.parametrize("ran_for", [3.0, 20.0])
@pytest.mark.parametrize("boot", [0.2, 3.0])
def test_device_that_starts_anew_is_noticed_and_stamped_right_at_once(ran_for, boot):
    clock = DeviceClock()
    steady(clock, ran_for, device_start=40_000_000)
    assert clock.resets == 0
    received = EPOCH + int((ran_for + boot) * NS)
    assert clock.stamps([0], received) == [received]
    assert clock.resets == 1
    assert steady(clock, 3, at=ran_for + boot) == 0


def test_reset_within_a_chunk():
    clock = DeviceClock()
    steady(clock, 5, device_start=100_000_000)
    received = EPOCH + 5 * NS
    stamps = clock.stamps([105_000_000, 0, 10_000], received)
    assert stamps == [received, received - 10_000_000, received]
    assert clock.resets == 1


def test_silence_longer_than_half_the_wrap_is_no_reset():
    clock = DeviceClock()
    steady(clock, 5)
    hours = 3 * 3600
    wrapped = int((5 + hours) * 1e6) % (1 << 32)
    received = EPOCH + (5 + hours) * NS
    (stamp,) = clock.stamps([wrapped], received)
    assert clock.resets == 0 and abs(stamp - received) < 1_000_000


def test_a_stalled_host_does_not_move_the_stamps():
    """Five seconds of frames that all come late, as after SIGSTOP."""
    clock = DeviceClock()
    steady(clock, 10)
    late = EPOCH + 15 * NS
    for first in range(0, 500, 50):
        stamps = clock.stamps([10_000_000 + (first + k) * 10_000 for k in range(50)], late)
        assert stamps == [EPOCH + 10 * NS + (first + k) * 10_000_000 for k in range(50)]
    assert clock.resets == 0


def test_a_late_sample_is_stamped_by_its_own_time():
    clock = DeviceClock()
    steady(clock, 3)
    received = EPOCH + 3 * NS
    first, late = clock.stamps([3_000_000, 2_995_000], received)
    assert first - late == 5_000_000


def test_narrow_clock_of_a_can_node():
    clock = DeviceClock(1 << 24)
    for k in range(10_000):  # 100 s, six wraps
        received = EPOCH + k * 10_000_000
        assert clock.stamps([k * 10_000 % (1 << 24)], received) == [received]
    assert clock.resets == 0


@FUZZ
@given(
    st.lists(
        st.tuples(st.integers(0, (1 << 32) - 1), st.integers(0, 10 * NS)), min_size=1, max_size=60
    )
)
def test_any_device_time_gives_a_stamp_not_later_than_its_receipt(frames):
    clock = DeviceClock()
    received = EPOCH
    for us, step in frames:
        received += step
        (stamp,) = clock.stamps([us], received)
        assert stamp <= received


def test_hull_slope_ignores_what_lies_above():
    points = [(float(x), 0.5 * x + (0.0 if x in (0, 9) else 3.0)) for x in range(10)]
    assert hull_slope(points) == pytest.approx(0.5)
