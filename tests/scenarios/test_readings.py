"""Readings that are wrong: what reaches the filter, through decoders and pipeline."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
import pytest

from gritd.drivers.build import build_decoder
from gritd.drivers.can_link import packed
from gritd.drivers.wire import CanWire, SerialWire
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.status import CHANNEL_BITS, Status
from gritd.estimator.wheel.sync import Sync
from tests.scenarios.rig import driven
from tests.scenarios.simulated import DRIVERS, PIPELINE, SETTINGS, START, TICK, shifted, ticks_of

REST = 1_400_000_000  # [ns] before a simulated run drives off
ESTIMATE = (
    "cohesion",
    "cohesion_sigma",
    "tan_phi",
    "tan_phi_sigma",
    "shear_modulus",
    "shear_modulus_sigma",
)


# ---- encoder rollover ----------------------------------------------------------------------------


@pytest.mark.parametrize("bits", [16, 32])
@pytest.mark.parametrize("direction", [1, -1])
def test_encoder_rollover(seed, bits, direction, figure):
    """The same motion far from the edge and across it, as bytes through the real framing: the
    same speed to the bit.
    """
    rng = random.Random(seed)
    steps = [rng.randrange(30) for _ in range(250)]
    far, near = ((1 << bits) // 2, (1 << bits) - 1500 if direction > 0 else 1500)
    speeds = [speed_through_wire(start, steps, direction, bits) for start in (far, near)]
    error = np.max(np.abs(np.array(speeds[0]) - np.array(speeds[1])))
    figure(
        "encoder rollover",
        DRIVERS,
        f"velocity error across 2^{bits}, either direction",
        error,
        "rad/s",
        0,
    )


def speed_through_wire(start, steps, direction, bits):
    settings = with_bits(bits)
    device = settings.devices["encoders"]
    wire, decoder, sync = SerialWire(device), build_decoder(settings, device), Sync(settings)
    count, speeds = start, []
    for number, step in enumerate(steps):
        t = START + number * TICK
        count += direction * step
        data = wire.encode("wheel_encoder", [count % (1 << bits)], number * 4000)
        for reading in decoder.decode(t, data):
            sync.push(reading)
        speeds.append(sync.snapshot(t).wheel_speed.value)
    return speeds[60:]


def with_bits(bits):
    channels = dict(SETTINGS.channels)
    channels["wheel_encoder"] = replace(channels["wheel_encoder"], bits=bits)
    return replace(SETTINGS, channels=channels)


# ---- jumps, stuck, impossible values -------------------------------------------------------------


def test_encoder_counter_jump(seed, figure):
    rng = random.Random(seed)
    clean = shifted(driven(8.0, seed))
    at, offset = clean[len(clean) // 2].stamp, rng.choice([-1, 1]) * rng.randrange(5000, 2**31)
    jumped = [
        r._replace(value=r.value + offset) if r.channel == "wheel_encoder" and r.stamp >= at else r
        for r in clean
    ]
    before, after = ticks_of(clean), ticks_of(jumped)
    assert after["jumps"][-1] == 1
    spike = np.nanmax(np.abs(after["wheel_speed"] - before["wheel_speed"])) / np.nanmax(
        np.abs(before["wheel_speed"])
    )
    moved = abs(after["cohesion"][-1] - before["cohesion"][-1]) / before["cohesion_sigma"][-1]
    figure("encoder counter jump", PIPELINE, "largest change of wheel speed", spike * 100, "%", 1)
    figure("encoder counter jump", PIPELINE, "change of c at the end", moved, "σ", 0.1)


@pytest.mark.parametrize("channel", ["wheel_encoder", "sinkage_pot", "motor_shunt", "wrench"])
def test_stuck_sensor(seed, channel, figure):
    rng = random.Random(seed)
    readings = shifted(driven(8.0, seed))
    since = START + int(rng.uniform(3.0, 5.0) * 1e9)
    held = next(r.value for r in reversed(readings) if r.channel == channel and r.stamp < since)
    frozen = [
        r._replace(value=held) if r.channel == channel and r.stamp >= since else r for r in readings
    ]
    ticks = ticks_of(frozen)
    stuck = (ticks["stuck"] & CHANNEL_BITS[channel]) > 0
    assert not np.any(stuck[ticks["stamp"] < since])
    noticed = (ticks["stamp"][stuck][0] - since) * 1e-9
    assert set(ticks["status"][stuck]) <= {Status.STUCK, Status.STANDSTILL}
    figure(
        "stuck sensor",
        PIPELINE,
        "noticed after it froze, tick's own delay of 0.05 s included",
        noticed,
        "s",
        0.4,
    )


def test_no_false_alarm_of_a_stuck_sensor(seed, figure):
    """Half a minute at rest and half a minute of driving with its stops."""
    pause = [r for r in shifted(driven(8.0, seed)) if r.stamp < START + REST]
    rest = [
        r._replace(stamp=r.stamp + n * REST, received=r.received + n * REST)
        for n in range(21)
        for r in pause
    ]
    alarms = np.sum(ticks_of(rest)["stuck"] > 0) + np.sum(
        ticks_of(shifted(driven(30.0, seed)))["stuck"] > 0
    )
    figure(
        "stuck sensor",
        PIPELINE,
        "ticks of false alarm, half a minute each at rest and driving",
        alarms,
        "",
        0,
    )


# ---- readings that look right but lie ------------------------------------------------------------

WHEEL = "wheel_encoder"
SILENT = "encoder silent while its counter wraps"
RANDOM = "random counter of the wheel"
DITHER = "sensor frozen but for its last digit"


@pytest.mark.parametrize("silence, said", [(10.0, 1), (0.2, 0)])
def test_an_encoder_that_is_silent_while_its_counter_wraps(seed, silence, said, figure):
    """16 bits, 65536 counts a turn: in ten seconds it wraps three times, and nobody can know."""
    rate, device = random.Random(seed).uniform(1.9, 2.1), SETTINGS.devices["encoders"]
    wire, decoder = SerialWire(device), build_decoder(with_bits(16), device)
    scale = SETTINGS.channels["wheel_encoder"].calibration.scale.value
    angles = {}
    for number in range(5000):
        seconds = number * 0.004
        if 1.0 < seconds < 1.0 + silence:
            continue
        counts = {"wheel_encoder": round(rate * seconds / scale), "carriage_encoder": number}
        for key, count in counts.items():
            data = wire.encode(key, [count % 65536], number * 4000)
            readings = decoder.decode(START + number * TICK, data)
            angles.update((seconds, r.value * scale) for r in readings if r.channel == WHEEL)

    unknown = {sensor.channel: sensor.turns_unknown for sensor in decoder.sensors}
    assert unknown["wheel_encoder"] == said and unknown["carriage_encoder"] == 0
    off = (rate * max(angles) - angles[max(angles)]) / (2.0 * math.pi)
    assert off == pytest.approx(round(off), abs=1e-3), "but for whole turns the angle is right"
    assert (abs(off) > 0.5) == bool(said)
    name = f"lines missing or too many after {silence:g} s"
    figure(SILENT, DRIVERS, name, abs(unknown["wheel_encoder"] - said), "", 0)
    figure(SILENT, DRIVERS, f"whole turns that are missing after {silence:g} s", abs(off))


@pytest.mark.parametrize("largest", [1 << 32, 1 << 16, 5000, 400])
def test_a_random_counter_of_the_wheel(seed, largest, figure):
    """From the middle of a run on, every count is drawn anew; 400 is within max_rate."""
    rng, clean = random.Random(seed), shifted(driven(16.0, seed))
    at = clean[len(clean) // 2].stamp
    wild = [
        r._replace(value=rng.randrange(largest))
        if r.channel == "wheel_encoder" and r.stamp >= at
        else r
        for r in clean
    ]
    ticks = ticks_of(wild)
    after = ticks["evaluated"] > at + 10**9 // 10
    assert np.sum(ticks["status"][~after] == Status.TRACKING) > 100
    updates = int(ticks["updates"][-1]) - int(ticks["updates"][after][0])
    believed = int(np.sum(ticks["status"][after] == Status.TRACKING))
    figure(RANDOM, PIPELINE, "updates of the filter", updates, "", 0)
    figure(RANDOM, PIPELINE, "ticks that say TRACKING", believed, "", 0)


@pytest.mark.parametrize("channel", ["sinkage_pot", "motor_shunt", "wrench"])
def test_a_sensor_frozen_but_for_its_last_digit(seed, channel, figure):
    """Converters of 12 bits over 5 V, and of 0.02 N and 0.002 N·m."""
    rng = random.Random(seed)
    digits = (0.02,) * 3 + (0.002,) * 3 if channel == "wrench" else (5.0 / 4096,)
    readings = shifted(driven(8.0, seed))
    since = START + int(rng.uniform(3.0, 5.0) * 1e9)
    held = next(r.value for r in reversed(readings) if r.channel == channel and r.stamp < since)

    def frozen():
        values = held if channel == "wrench" else (held,)
        shown = tuple(v + rng.randrange(2) * d for v, d in zip(values, digits, strict=True))
        return shown if channel == "wrench" else shown[0]

    dithering = [
        r._replace(value=frozen()) if r.channel == channel and r.stamp >= since else r
        for r in readings
    ]
    ticks = ticks_of(dithering)
    stuck = (ticks["stuck"] & CHANNEL_BITS[channel]) > 0
    assert not np.any(stuck[ticks["stamp"] < since])
    assert set(ticks["status"][stuck]) <= {Status.STUCK, Status.STANDSTILL}
    noticed = (ticks["stamp"][stuck][0] - since) * 1e-9
    figure(DITHER, PIPELINE, "noticed after it froze", noticed, "s", 0.45)


def test_a_live_sensor_of_coarse_digits_is_not_taken_for_frozen(seed, figure):
    """Every analogue channel as a converter of 12 bits shows it, with half the noise stated, and
    as one of 16 bits with a tenth.
    """
    rng, alarms = random.Random(seed), 0
    for digit, share in ((5.0 / 4096, 0.5), (5.0 / 65536, 0.1)):
        quiet = [with_noise(r, rng, digit, share) for r in shifted(driven(30.0, seed))]
        alarms += int(np.sum(ticks_of(quiet)["stuck"] > 0))
    figure(DITHER, PIPELINE, "ticks of false alarm in a minute of driving", alarms, "", 0)


def with_noise(reading, rng, digit, share):
    """A reading of potentiometer or shunt on the digits of a converter, with a share of the noise
    stated.
    """
    if reading.channel not in SIGNALS:
        return reading
    noise = SETTINGS.channels[reading.channel].noise
    steady = round(reading.value / (20.0 * noise)) * 20.0 * noise  # its own noise taken out
    noisy = steady + rng.gauss(0.0, share * noise)
    return reading._replace(value=round(noisy / digit) * digit)


NO_NUMBERS = (math.nan, math.inf, -math.inf)
AXES = 6


def test_not_a_number_infinity_and_out_of_range(seed, figure):
    """Every analogue field in turn with every impossible value and just beyond its limits, among
    good readings: as bytes on the wire, where the driver must stop what is no number, and past
    the drivers, where the pipeline must.
    """
    rng = random.Random(seed)
    cases = [*impossible()] * 3
    rng.shuffle(cases)
    device = SETTINGS.devices["bus"]
    wire, decoder = CanWire(device), build_decoder(SETTINGS, device)
    readings, refused, numbers, wires = [], 0, 0, 0
    clean = shifted(driven(16.0, seed))
    places = dict(
        zip(sorted(rng.sample(range(1000, len(clean) - 100), len(cases))), cases, strict=True)
    )
    for number, r in enumerate(clean):
        readings.append(r)
        if number in places:
            channel, value = places[number]
            readings.append(Reading(r.stamp + 1, channel, value, r.received))
            refused += isinstance(value, float) or not math.isnan(
                value[1]
            )  # one absent axis is no fault
            if (signal := SIGNALS.get(channel)) and not math.isfinite(value):
                wires += 1
                numbers += bool(
                    decoder.decode(
                        r.received, packed(wire.encode(signal, [value], r.stamp // 1000))
                    )
                )
    ticks = ticks_of(readings)
    unfit = sum(int(np.sum(~np.isfinite(ticks[name]))) for name in ESTIMATE)
    row = "NaN, Inf, out of range"
    assert wires >= 18 and np.sum(ticks["status"] == Status.TRACKING) > 300
    figure(row, DRIVERS, "no numbers that passed the driver", numbers, "", 0)
    figure(
        row,
        DRIVERS,
        f"impossible values not counted, of {refused}",
        refused - int(ticks["invalid"][-1]),
        "",
        0,
    )
    figure(row, DRIVERS, "non-finite estimates", unfit, "", 0)


SIGNALS = {"sinkage_pot": "SinkagePot.Volts", "motor_shunt": "MotorShunt.Volts"}


def impossible():
    """Channel and value: of scalar channels and of each axis of the wrench."""
    for channel in ("sinkage_pot", "motor_shunt", "motor_temperature"):
        known = SETTINGS.channels[channel]
        for value in (
            *NO_NUMBERS,
            1e300,
            -1e300,
            np.nextafter(known.low, -9e9),
            np.nextafter(known.high, 9e9),
        ):
            yield channel, float(value)
    limits = [SETTINGS.wrench.max_force] * 3 + [SETTINGS.wrench.max_torque] * 3
    for axis, limit in enumerate(limits):
        for value in (
            math.inf,
            -math.inf,
            1e300,
            -1e300,
            np.nextafter(limit, 9e9),
            -np.nextafter(limit, 9e9),
        ):
            yield "wrench", tuple(float(value) if n == axis else 0.1 for n in range(AXES))
    yield "wrench", (0.1, 0.1, math.nan, 0.1, 0.1, 0.1)  # without a load it is no wrench
    yield "wrench", (0.1, math.nan, 0.1, 0.1, 0.1, 0.1)
