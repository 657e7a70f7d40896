"""From configuration to readers: any sensor on either bus, one clear line where it cannot work."""

from __future__ import annotations

import random
import re
from dataclasses import replace
from itertools import pairwise, permutations
from pathlib import Path

import pytest

from gritd.drivers.build import build_decoder, build_readers, used_devices
from gritd.drivers.dbc import MAX_DBC_BYTES
from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.queue import ReadingQueue
from gritd.drivers.wire import CanWire, SerialWire
from gritd.estimator.config.configuration import load
from gritd.estimator.messages.readings import CHANNELS, ENCODERS
from tests.drivers.rig import (
    CAN_SIGNALS,
    Ticking,
    can_device,
    channel,
    chunk,
    serial_device,
    wiring,
    wrench,
)

VALUES = {name: (70_000 if name in ENCODERS else 1.25,) for name in CHANNELS}
VALUES["wrench"] = (1.0, 2.0, 3.0, 0.5, 0.25, -0.5)
WRENCH_MESSAGES = {"WrenchForce": slice(0, 3), "WrenchTorque": slice(3, 6)}


def build(settings):
    return build_readers(settings, Ticking(), ReadingQueue())


def settings_for(name, device):
    """One channel on one device."""
    on_can = device.kind == "can"
    if name == "wrench":
        return wiring(
            [device], [], wrench(device.name, "+".join(WRENCH_MESSAGES) if on_can else "wrench")
        )
    return wiring([device], [channel(name, device.name, CAN_SIGNALS[name] if on_can else name)])


@pytest.mark.parametrize("name", list(CHANNELS))
@pytest.mark.parametrize("framing", ["cobs", "ascii"])
def test_any_sensor_on_a_serial_port_by_configuration_alone(name, framing):
    device = serial_device(framing=framing)
    decoder = build_decoder(settings_for(name, device), device)
    (reading,) = decoder.decode(10**18, SerialWire(device).encode(name, VALUES[name], 5000))
    assert reading == (10**18, name, VALUES[name] if name == "wrench" else VALUES[name][0], 10**18)


@pytest.mark.parametrize("name", list(CHANNELS))
def test_any_sensor_on_a_can_bus_by_configuration_alone(name):
    device = can_device()
    decoder, wire = build_decoder(settings_for(name, device), device), CanWire(device)
    if name == "wrench":
        messages = [wire.encode(key, VALUES[name][part]) for key, part in WRENCH_MESSAGES.items()]
    else:
        messages = [wire.encode(CAN_SIGNALS[name], VALUES[name], 5000)]
    (reading,) = [
        reading for message in messages for reading in decoder.decode(10**18, chunk(message))
    ]
    assert reading.channel == name
    assert reading.value == (VALUES[name] if name == "wrench" else VALUES[name][0])


@pytest.mark.parametrize("cycles", [2, 5])
def test_what_came_in_one_read_without_a_time_is_several_samples(cycles):
    """A late read holds several cycles of a sensor without a clock: the last is not the only one
    that counts, and none is later than its receipt.
    """
    device = can_device()
    decoder, wire = build_decoder(settings_for("wrench", device), device), CanWire(device)
    messages = [
        wire.encode(key, VALUES["wrench"][part])
        for _ in range(cycles)
        for key, part in WRENCH_MESSAGES.items()
    ]
    readings = decoder.decode(10**18, b"".join(chunk(message) for message in messages))
    stamps = [reading.stamp for reading in readings]
    assert len(readings) == cycles and stamps == sorted(set(stamps))
    assert all(10**18 - 1000 < stamp <= 10**18 for stamp in stamps)


@pytest.mark.parametrize("together", [1, 3])
@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_a_wrench_is_stamped_by_its_own_clock_whatever_the_order(order, together):
    """Cycles every 4 ms that come up to 8 ms late, several at once, their messages in any order, a
    read ending between them.
    """
    device, key = can_device(), "WrenchForce+WrenchTorque+WrenchTime"
    decoder, wire = build_decoder(wiring([device], [], wrench("bus", key)), device), CanWire(device)
    parts = {"WrenchForce": (1.0, 2.0, 3.0), "WrenchTorque": (0.5, 0.25, -0.5), "WrenchTime": ()}
    cycles = [
        [chunk(wire.encode(name, values, 4000 * n + 7)) for name, values in parts.items()]
        for n in range(600)
    ]
    readings, rng, received = [], random.Random(1), 10**18
    for first in range(0, 600, together):
        late = rng.randrange(8_000_000)
        received = max(received, 10**18 + 4_000_000 * (first + together) + late)
        sent = [cycle[place] for cycle in cycles[first : first + together] for place in order]
        cut = rng.randrange(len(sent))
        for piece in (sent[:cut], sent[cut:]):
            readings += decoder.decode(received, b"".join(piece))
    stamps = [reading.stamp for reading in readings]
    assert len(readings) == 600 and {r.value for r in readings} == {VALUES["wrench"]}
    assert all(abs(b - a - 4_000_000) < 100_000 for a, b in pairwise(stamps[-300:]))


def test_one_reader_for_each_device_in_use():
    devices = [serial_device(name="a"), can_device(name="b"), serial_device(name="unused")]
    channels = [channel("wheel_encoder", "a"), channel("sinkage_pot", "b", "SinkagePot.Volts")]
    settings = wiring(devices, channels, wrench("a"))
    assert [reader.device for reader in build(settings)] == ["a", "b"]
    assert [device.name for device in used_devices(settings)] == ["a", "b"]


def test_two_devices_may_be_clocked_differently():
    """On one CAN bus every node has its own clock: a jump of one leaves the other alone."""
    device = can_device()
    channels = [
        channel(name, "bus", CAN_SIGNALS[name]) for name in ("wheel_encoder", "sinkage_pot")
    ]
    decoder, wire = build_decoder(wiring([device], channels), device), CanWire(device)
    for n in range(300):
        received = 10**18 + n * 10_000_000
        for key, start in (("WheelEncoder.Count", 0), ("SinkagePot.Volts", 9_000_000)):
            (reading,) = decoder.decode(received, chunk(wire.encode(key, [1], start + n * 10_000)))
            assert reading.stamp == received


def test_a_device_that_restarts_does_not_turn_the_wheel():
    """A tenth of a second is lost until its clock is believed."""
    device = serial_device()
    decoder = build_decoder(wiring([device], [channel("wheel_encoder", "encoders")]), device)
    before, after = SerialWire(device), SerialWire(device)
    counts = []
    for n in range(100):
        counts += decoder.decode(
            10**18 + n * 10_000_000, before.encode("wheel_encoder", [5000 + n], 10**7 + n * 10_000)
        )
    for n in range(100):
        counts += decoder.decode(
            10**18 + (200 + n) * 10_000_000, after.encode("wheel_encoder", [n], n * 10_000)
        )
    values = [reading.value for reading in counts]
    assert values[:100] == [*range(5000, 5100)] and len(values) >= 189
    assert values[100:] == [*range(5099, 5099 + len(values) - 100)]
    assert decoder.framing.counts.lost == 0


@pytest.mark.parametrize(
    "settings, expected",
    [
        (
            wiring([serial_device()], [channel("wheel_encoder", "nope")]),
            "no device 'nope', there are: encoders",
        ),
        (
            wiring([can_device()], [channel("wheel_encoder", "bus", "Nope.Count")]),
            "no message Nope in its database",
        ),
        (
            wiring(
                [can_device()], [channel("wheel_encoder", "bus", "WheelEncoder.Count", bits=16)]
            ),
            "bits is 16, but",
        ),
        (
            wiring([can_device()], [channel("wheel_encoder", "bus", "SinkagePot.Volts")]),
            "Volts is a float; expected `resolution`",
        ),
        (
            wiring([can_device()], [channel("wheel_encoder", "bus", "WrenchForce")]),
            "channel wheel_encoder: 3 signals, expected one",
        ),
        (
            wiring([can_device()], [channel("sinkage_pot", "bus", "WrenchForce")]),
            "expected one signal",
        ),
        (
            wiring([can_device()], [], wrench("bus", "WrenchTorque+WrenchForce")),
            "its signals are tx ty tz fx fy fz",
        ),
        (wiring([can_device()], [], wrench("bus", "WrenchForce")), "expected fx fy fz tx ty tz"),
        (wiring([serial_device()], [], wrench("encoders", "f+t")), "expected one key"),
        (
            wiring([can_device("nope")], [channel("sinkage_pot", "bus", "SinkagePot.Volts")]),
            "no CAN interface 'nope'",
        ),
        (
            wiring([can_device(dbc="/nope.dbc")], [channel("sinkage_pot", "bus", "A.B")]),
            "/nope.dbc: cannot read: no such",
        ),
    ],
)
def test_wiring_that_cannot_work_is_one_clear_line(settings, expected):
    with pytest.raises(DeviceSettingsError) as error:
        build(settings)
    assert expected in str(error.value) and "\n" not in str(error.value)


SCALED = {"E.Angle": {"id": 5, "start": 0, "length": 16, "scale": 0.1, "offset": -180.0}}
FLOATS = {"E.Angle": {"id": 5, "start": 0, "length": 32, "is_float": True}}
SIGNED = {"E.Angle": {"id": 5, "start": 0, "length": 16, "signed": True}}


@pytest.mark.parametrize(
    ("signals", "settings"),
    [
        (SCALED, {"bits": 16, "modulus": 3600}),
        (SCALED, {"bits": 16}),
        (SIGNED, {"bits": 16}),
        (SIGNED, {"modulus": 9000}),
        (FLOATS, {"modulus": 36000, "resolution": 0.01}),
        (FLOATS, {"resolution": 0.001}),
    ],
)
def test_an_encoder_sends_degrees_turns_or_scaled_numbers(signals, settings):
    """Over a turn and a half, both ways, what is sent and read are the same counts."""
    device = can_device(dbc="", signals=signals)
    encoder = replace(channel("wheel_encoder", "bus", "E.Angle"), **settings)
    decoder = build_decoder(wiring([device], [encoder]), device)
    (sensor,), wire = decoder.sensors, CanWire(device)
    turned = [*range(0, 1500, 31), *range(1500, -5000, -77)]
    counts = []
    for n, total in enumerate(turned):
        message = wire.encode("E.Angle", sensor.sent(total))
        counts += [r.value for r in decoder.decode(10**18 + n * 10**7, chunk(message))]
    assert counts == turned and isinstance(counts[0], int)


def test_an_encoder_that_cannot_count_so_far_is_one_line():
    device = can_device(dbc="", signals=SIGNED)
    encoder = replace(channel("wheel_encoder", "bus", "E.Angle"), modulus=70_000)
    with pytest.raises(DeviceSettingsError, match="modulus is 70000, but signal Angle has 16 bits"):
        build(wiring([device], [encoder]))


def test_what_is_no_database_is_one_clear_line(tmp_path):
    large = tmp_path / "large.dbc"
    large.write_bytes(b"\n" * (MAX_DBC_BYTES + 1))
    named = replace(can_device(), dbc="", signals={"Volts": {"id": 1, "start": 0, "length": 8}})
    for device, expected in (
        (can_device(dbc=str(large)), f"{large}: is larger than {MAX_DBC_BYTES} bytes"),
        (named, "signal Volts: expected a name of the form Message.Signal"),
    ):
        with pytest.raises(DeviceSettingsError, match=re.escape(expected)) as error:
            build_decoder(wiring([device], [channel("sinkage_pot", "bus", "A.B")]), device)
        assert "\n" not in str(error.value)


def test_wrench_messages_without_a_cycle_are_refused():
    axes = ("fx", "fy", "fz", "tx", "ty", "tz")
    signals = {
        f"{'F' if n < 3 else 'T'}.{axis}": {"id": 1 + n // 3, "start": n % 3 * 16, "length": 16}
        for n, axis in enumerate(axes)
    }
    with pytest.raises(
        DeviceSettingsError, match="F and T make one value, expected a Cycle signal in each"
    ):
        build(wiring([can_device(dbc="", signals=signals)], [], wrench("bus", "F+T")))


def test_the_delivered_configuration_builds_its_readers():
    settings = load(Path(__file__).parents[2] / "config" / "testbed.yaml").settings
    assert [reader.device for reader in build(settings)] == ["encoders", "bus"]
