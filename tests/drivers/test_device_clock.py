"""The device clock: delays of the way do not become errors of the stamps, nor of the speed."""

from __future__ import annotations

import random
from statistics import mean, pstdev

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.drivers.device_clock import DeviceClock
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


def anew(clock, at, device_start, frames=40):
    """Frames without delay from `at` [s] on, of a clock that shows `device_start` [µs] then; the
    stamps' errors [ns], None where there is no stamp.
    """
    errors = []
    for k in range(frames):
        received = EPOCH + int(at * NS) + k * NS // 100
        (stamp,) = clock.stamps([(device_start + k * 10_000) % (1 << 32)], received)
        errors.append(None if stamp is None else stamp - received)
    return errors


@pytest.mark.parametrize("ran_for", [3.0, 20.0])
@pytest.mark.parametrize("boot", [0.2, 3.0])
def test_device_that_starts_anew_is_noticed_and_stamped_right_after_a_tenth_of_a_second(
    ran_for, boot
):
    clock = DeviceClock()
    steady(clock, ran_for, device_start=40_000_000)
    assert clock.restarts == 0
    errors = anew(clock, ran_for + boot, 0)
    assert errors[:10] == [None] * 10 and not any(errors[11:])
    assert (clock.restarts, clock.steps, clock.rejected) == (1, 1, errors.count(None))


def test_a_device_that_starts_anew_after_a_long_silence_is_believed_at_once():
    clock = DeviceClock()
    steady(clock, 20.0, device_start=40_000_000)
    assert not any(anew(clock, 60.0, 0))
    assert clock.restarts == 1


@pytest.mark.parametrize("step", [-9.0, -0.49, -0.1, -0.06, -0.03, 0.012, 0.0655, 0.2, 0.9, 7.0])
def test_a_step_of_the_clock_is_recognised_within_a_fifth_of_a_second(step):
    clock = DeviceClock()
    steady(clock, 5.0, device_start=40_000_000)
    errors = anew(clock, 5.0, round((45.0 + step) * 1e6))
    assert errors.count(None) <= 20 and not any(error for error in errors[20:])
    assert clock.steps == 1 and clock.restarts == 0
    assert clock.step == pytest.approx(step, abs=1e-6)


@pytest.mark.parametrize("step", [-0.019, -0.004, 0.003, 0.009])
def test_a_small_step_is_followed_within_a_second_where_the_way_is_steady(step):
    clock = DeviceClock()
    steady(clock, 5.0, device_start=40_000_000)
    errors = anew(clock, 5.0, round((45.0 + step) * 1e6), frames=140)
    assert None not in errors and not any(error for error in errors[105:])


@pytest.mark.parametrize("off", [-3.0, -0.4, -0.0655, -0.03, 0.025, 0.0655, 0.2, 3.0, 1000.0])
def test_one_wrong_stamp_is_lost_alone(off):
    """Of 100 frames a second, the first in the chunk, in its middle, or by itself."""
    clock = DeviceClock()
    steady(clock, 5.0, device_start=40_000_000)
    (wrong,) = clock.stamps([round((45.0 + off) * 1e6)], EPOCH + 5 * NS)
    assert wrong is None and clock.rejected == 1
    after = anew(clock, 5.01, 45_010_000)
    assert not any(after) and None not in after
    received = EPOCH + int(5.43 * NS)
    times = [45_410_000, round((45.42 + off) * 1e6), 45_430_000]
    first, wrong, last = clock.stamps(times, received)
    assert wrong is None and (first, last) == (received - 20_000_000, received)
    assert clock.steps == 0 and clock.rejected == 2


def test_wrong_stamps_in_between_do_not_delay_the_recognition_of_a_step():
    clock, errors = DeviceClock(), []
    steady(clock, 5.0, device_start=40_000_000)
    for k in range(30):
        off = 0.0655 if k in (3, 7) else 0.0
        received = EPOCH + 5 * NS + k * NS // 100
        (stamp,) = clock.stamps([round((44.8 + k / 100 + off) * 1e6)], received)
        errors.append(None if stamp is None else stamp - received)
    assert errors.count(None) <= 14 and not any(errors[14:]) and clock.steps == 1


def test_a_wrong_stamp_in_the_first_moment_is_forgotten():
    clock = DeviceClock()
    (first,) = clock.stamps([40_200_000], EPOCH)
    assert first is not None
    errors = anew(clock, 0.01, 40_010_000, frames=60)
    assert None not in errors and not any(errors)


@pytest.mark.parametrize("rate", [0.03, 0.97, 1.01, 1.2, 8.0, 1000.0])
def test_a_clock_of_another_rate_does_not_lose_the_sensor(rate):
    """After some seconds its frames are stamped when they come, more or less."""
    clock = DeviceClock()
    steady(clock, 5.0)
    errors = []
    for k in range(1200):
        received = EPOCH + 5 * NS + k * NS // 100
        (stamp,) = clock.stamps([5_000_000 + int(k * 10_000 * rate)], received)
        errors.append(None if stamp is None else stamp - received)
    assert errors.count(None) <= 60 and None not in errors[60:]
    assert min(errors[600:]) >= -0.2e9


@pytest.mark.parametrize("late", [0.03, 0.1, 0.445])
def test_a_computer_that_is_too_slow_is_no_step(late):
    """All comes late, steadily and for seconds: it reads no faster than the device sends."""
    clock = DeviceClock()
    steady(clock, 5.0)
    for k in range(400):
        received = EPOCH + int((5.0 + late) * NS) + k * NS // 100
        (stamp,) = clock.stamps([5_000_000 + k * 10_000], received)
        assert stamp == EPOCH + 5 * NS + k * NS // 100
    assert not any(anew(clock, 9.0 + late, int((9.0 + late) * 1e6)))
    assert clock.steps == 0 and clock.rejected == 0


def test_reset_within_a_chunk():
    clock = DeviceClock()
    steady(clock, 5, device_start=100_000_000)
    received = EPOCH + 5 * NS
    assert clock.stamps([105_000_000, 0, 10_000], received) == [received, None, None]
    errors = anew(clock, 5.01, 20_000)
    assert clock.restarts == 1 and not any(errors[10:]) and None not in errors[10:]


def test_silence_longer_than_half_the_wrap_is_no_reset():
    clock = DeviceClock()
    steady(clock, 5)
    hours = 3 * 3600
    wrapped = int((5 + hours) * 1e6) % (1 << 32)
    received = EPOCH + (5 + hours) * NS
    (stamp,) = clock.stamps([wrapped], received)
    assert clock.steps == 0 and abs(stamp - received) < 1_000_000


def test_a_stalled_host_does_not_move_the_stamps():
    """Five seconds of frames that all come late, as after SIGSTOP."""
    clock = DeviceClock()
    steady(clock, 10)
    late = EPOCH + 15 * NS
    for first in range(0, 500, 50):
        stamps = clock.stamps([10_000_000 + (first + k) * 10_000 for k in range(50)], late)
        assert stamps == [EPOCH + 10 * NS + (first + k) * 10_000_000 for k in range(50)]
    assert clock.steps == 0 and clock.rejected == 0


def test_a_wrong_stamp_among_frames_that_were_held_back_moves_no_other():
    """The race of a 16-bit timer, 65.5 ms ahead, in a chunk that came 60 ms late."""
    clock = DeviceClock()
    for k in range(1000):
        clock.stamps([device_us(k / 500)], EPOCH + int((k / 500 + 1e-4) * NS))
    held = [2.0 + k / 500 for k in range(30)]
    shown = [device_us(t + 65.536e-3 * (k == 2)) for k, t in enumerate(held)]
    stamps = clock.stamps(shown, EPOCH + int(2.0601 * NS))
    away = [abs((stamp - EPOCH) / NS - t) for stamp, t in zip(stamps, held, strict=True)]
    assert max(away[:2] + away[3:]) < 1e-3


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
    assert clock.steps == 0 and clock.rejected == 0


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
        assert stamp is None or stamp <= received
