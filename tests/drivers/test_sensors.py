"""Sensor kinds: exact counts across rollovers, impossible values refused, never a value made up."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.drivers.framing import Frame
from gritd.drivers.sensor import Analog, Encoder, modular_difference, sensor_kinds
from gritd.estimator.messages.readings import CHANNELS, ENCODERS
from tests.drivers.rig import FUZZ, INF, channel, wrench

KINDS = sensor_kinds()


def build(name, **values):
    return KINDS[name](
        wrench("dev", **values) if name == "wrench" else channel(name, "dev", **values)
    )


def frame(*values, key="k", sequence=None):
    return Frame(key, sequence, None, values)


# ---- the folder ----------------------------------------------------------------------------------


def test_every_channel_has_its_sensor_and_every_sensor_its_channel():
    assert set(KINDS) == set(CHANNELS)


@pytest.mark.parametrize("name", sorted(KINDS))
def test_the_shape_of_a_sensor_kind(name):
    """What every file in drivers/sensors must offer, a new one included."""
    sensor = build(name)
    assert sensor.channel == name and sensor.keys and sensor.quarantined == 0
    assert type(sensor).__doc__ and type(sensor).__module__ == f"gritd.drivers.sensors.{name}"
    value = sensor.value(frame(*[1] * len(CHANNELS[name]), key=sensor.keys[0]))
    assert value is not None
    if len(CHANNELS[name]) == 1:
        assert isinstance(value, int if name in ENCODERS else float)
    else:
        assert len(value) == len(CHANNELS[name])
    sensor.reset()


@pytest.mark.parametrize("name", sorted(KINDS))
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_every_field_that_is_not_finite_is_quarantined(name, bad):
    fields = len(CHANNELS[name])
    for field in range(fields):
        sensor = build(name)
        values = [1.0] * fields
        values[field] = bad
        assert sensor.value(frame(*values, key=sensor.keys[0])) is None
        assert sensor.quarantined == 1


@pytest.mark.parametrize("name", sorted(KINDS))
def test_a_frame_with_the_wrong_number_of_values_is_quarantined(name):
    sensor = build(name)
    assert sensor.value(frame(*[1] * (len(CHANNELS[name]) + 1), key=sensor.keys[0])) is None
    assert sensor.quarantined == 1


# ---- encoders ------------------------------------------------------------------------------------


@FUZZ
@given(
    st.sampled_from([1 << bits for bits in (8, 16, 24, 32, 64)]) | st.integers(8, 1 << 40),
    st.integers(-(1 << 70), 1 << 70),
    st.lists(st.integers(-100, 100), max_size=50),
    st.booleans(),
)
def test_counts_are_exact_across_every_wrap_in_both_directions(modulus, start, moves, signed):
    """Steps of up to half the range, a counter shown signed or unsigned, starting anywhere."""
    half = modulus // 2
    sensor = Encoder(replace(channel("wheel_encoder", "dev"), modulus=modulus))

    def shown(count):
        return (count + half) % modulus - half if signed else count % modulus

    total = start
    first = sensor.value(frame(shown(total)))
    for move in moves:
        total += move * (half - 1) // 100
        assert sensor.value(frame(shown(total))) - first == total - start


@FUZZ
@given(st.lists(st.floats(-170.0, 170.0), min_size=1, max_size=50), st.floats(0.0, 360.0))
def test_degrees_that_wrap_are_unwrapped_to_half_a_count(moves, start):
    sensor = Encoder(replace(channel("wheel_encoder", "dev"), modulus=36_000, resolution=0.01))
    angle, first = start, sensor.value(frame(start % 360.0))
    for move in moves:
        angle += move
        read = sensor.value(frame(angle % 360.0))
        assert abs(0.01 * (read - first) - (angle - start)) <= 0.011


@pytest.mark.parametrize("sent", [math.nan, math.inf, -400.0, 360.1])
def test_an_angle_that_cannot_be_is_quarantined(sent):
    sensor = Encoder(replace(channel("wheel_encoder", "dev"), modulus=36_000, resolution=0.01))
    assert sensor.value(frame(sent)) is None and sensor.quarantined == 1


@pytest.mark.parametrize("bits", [16, 32])
@pytest.mark.parametrize("direction", [1, -1])
def test_constant_speed_through_the_rollover_has_no_step(bits, direction):
    sensor = Encoder(channel("wheel_encoder", "dev", bits=bits))
    step = 37 * direction
    raw = [(-20 * step + n * step) % (1 << bits) for n in range(40)]
    counts = [sensor.value(frame(count)) for count in raw]
    assert {b - a for a, b in pairwise(counts)} == {step}


def test_modular_difference_at_the_edges():
    assert modular_difference(0, 65535, 1 << 16) == 1
    assert modular_difference(65535, 0, 1 << 16) == -1
    assert modular_difference(0, (1 << 32) - 1, 1 << 32) == 1
    assert modular_difference(0, 8999, 9000) == 1


def test_after_a_reset_the_total_goes_on_without_a_jump():
    sensor = Encoder(channel("wheel_encoder", "dev"))
    sensor.value(frame(1_000_000))
    assert sensor.value(frame(1_000_100)) == 1_000_100
    sensor.reset()
    assert sensor.value(frame(7)) == 1_000_100
    assert sensor.value(frame(9)) == 1_000_102


@pytest.mark.parametrize("count", [1 << 16, -(1 << 15) - 1, 5.0])
def test_a_count_that_the_counter_cannot_show_is_quarantined(count):
    sensor = Encoder(channel("wheel_encoder", "dev", bits=16))
    assert sensor.value(frame(count)) is None and sensor.quarantined == 1
    assert sensor.value(frame(10)) == 10 and sensor.value(frame(12)) == 12


@pytest.mark.parametrize(
    "seconds, max_rate, count", [(0.33, 1e5, 1), (0.32, 1e5, 0), (1e6, INF, 0)]
)
def test_a_silence_in_which_the_counter_may_have_gone_half_round_is_counted(
    seconds, max_rate, count
):
    sensor = Encoder(replace(channel("wheel_encoder", "dev", bits=16), max_rate=max_rate))
    sensor.elapsed(1e6)  # nothing came before
    sensor.value(frame(65_000))
    sensor.elapsed(0.004)
    assert sensor.value(frame(65_100)) == 65_100 and sensor.turns_unknown == 0
    sensor.elapsed(seconds)
    assert sensor.turns_unknown == count
    assert sensor.value(frame(164)) == 65_700, "still what the counter shows, but for whole rounds"


# ---- analogue ------------------------------------------------------------------------------------


@FUZZ
@given(st.floats() | st.integers(-(1 << 63), 1 << 63))
def test_analog_passes_what_is_in_range_and_nothing_else(value):
    sensor = Analog(channel("sinkage_pot", "dev", low=-1.0, high=4.9))
    got = sensor.value(frame(value))
    valid = math.isfinite(value) and -1.0 <= value <= 4.9
    assert got == (value if valid else None)
    assert sensor.quarantined == (not valid)


# ---- wrench --------------------------------------------------------------------------------------


def two_part():
    """A wrench in two frames, and the two frames of cycle n."""

    def force(n):
        return frame(1.0 * n, 2.0, 3.0, key="F", sequence=n)

    def torque(n):
        return frame(4.0, 5.0, 6.0, key="T", sequence=n)

    return build("wrench", signal="F+T"), force, torque


def test_wrench_from_two_frames_of_one_cycle_in_any_order():
    sensor, force, torque = two_part()
    assert sensor.value(force(1)) is None
    assert sensor.value(torque(1)) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert sensor.value(torque(2)) is None
    assert sensor.value(force(2)) == (2.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    assert sensor.incomplete == 0


def test_wrench_never_mixes_cycles_and_counts_the_incomplete():
    sensor, force, torque = two_part()
    sensor.value(force(1))
    assert sensor.value(torque(2)) is None
    assert sensor.value(force(3)) is None
    assert sensor.value(torque(3))[0] == 3.0
    assert sensor.incomplete == 2


def test_wrench_forgets_its_half_at_a_reset():
    sensor, force, torque = two_part()
    sensor.value(force(1))
    sensor.reset()
    assert sensor.value(torque(1)) is None


@pytest.mark.parametrize("field, value", [(0, 500.1), (2, -500.1), (3, 50.1), (5, -50.1)])
def test_wrench_beyond_its_limits_is_quarantined(field, value):
    sensor = build("wrench")
    values = [0.0] * 6
    values[field] = value
    assert sensor.value(frame(*values, key="wrench")) is None and sensor.quarantined == 1
