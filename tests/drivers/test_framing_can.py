"""CAN messages to frames: the delivered DBC, inline definitions, counters, and hostile messages."""

from __future__ import annotations

import random
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.drivers.can_signals import MAX_INLINE, RULES, database
from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.framing import Frame
from gritd.drivers.framing_can import ERROR, EXTENDED, REMOTE, CanFraming, pack
from gritd.drivers.wire import CanWire
from gritd.estimator.messages.readings import CHANNELS, WRENCH_FIELDS
from tests.drivers.rig import CAN_SIGNALS, FUZZ, can_device, chunk

ALL_KEYS = [*CAN_SIGNALS.values(), "WrenchForce", "WrenchTorque"]


def framing(keys=ALL_KEYS, **device):
    bus = can_device(**device)
    return CanFraming(bus.name, database(bus), keys)


def inline(**signals):
    return {
        "dbc": "",
        "signals": {name.replace("__", "."): value for name, value in signals.items()},
    }


# ---- the delivered database ----------------------------------------------------------------------


def test_database_has_every_channel_with_counter_and_distinct_ids():
    db = database(can_device())
    messages = {message.name: message for message in db.messages}
    assert {CAN_SIGNALS[c].partition(".")[0] for c in CHANNELS if c != "wrench"} <= set(messages)
    assert len({m.frame_id for m in db.messages}) == len(db.messages)
    for message in db.messages:
        assert message.length <= 8
        assert {"Sequence", "Cycle"} & {signal.name for signal in message.signals}
    wrench = [
        s.name.lower()
        for name in ("WrenchForce", "WrenchTorque")
        for s in messages[name].signals[:3]
    ]
    assert wrench == list(WRENCH_FIELDS)


@FUZZ
@given(st.integers(0, (1 << 32) - 1), st.integers(0, 1 << 40))
def test_counts_are_exact_and_device_time_is_to_4_us(count, device_us):
    got = framing().decode(
        chunk(CanWire(can_device()).encode("WheelEncoder.Count", [count], device_us))
    )
    assert got == [Frame("WheelEncoder.Count", 0, device_us % (1 << 24) // 4 * 4, (count,))]
    assert isinstance(got[0].values[0], int)


@FUZZ
@given(st.lists(st.floats(-60.0, 60.0), min_size=6, max_size=6))
def test_wrench_in_two_messages_of_one_cycle(values):
    wire, decoder = CanWire(can_device()), framing()
    force = decoder.decode(chunk(wire.encode("WrenchForce", values[:3])))[0]
    torque = decoder.decode(chunk(wire.encode("WrenchTorque", values[3:])))[0]
    assert force.sequence == torque.sequence == 0
    assert force.values == pytest.approx(values[:3], abs=0.011) and torque.values == pytest.approx(
        values[3:], abs=0.0011
    )


@pytest.mark.parametrize("volts", [0.0, -0.5, float("nan"), float("inf")])
def test_float_volts_arrive_as_they_are(volts):
    got = framing().decode(chunk(CanWire(can_device()).encode("SinkagePot.Volts", [volts])))
    assert struct.pack("f", got[0].values[0]) == struct.pack("f", volts)


def test_the_clock_of_each_message_is_its_own_and_wraps_at_its_width():
    assert framing().clock_modulus("WheelEncoder.Count") == 1 << 24


# ---- what is listened to -------------------------------------------------------------------------


def test_filters_name_exactly_the_wanted_ids():
    filters = framing(["WheelEncoder.Count", "SinkagePot.Volts"]).filters()
    assert sorted(f["can_id"] for f in filters) == [0x100, 0x110]
    assert all(f["extended"] is False for f in filters)


def test_unwanted_messages_are_ignored():
    decoder = framing(["WheelEncoder.Count"])
    assert decoder.decode(chunk(CanWire(can_device()).encode("SinkagePot.Volts", [1.0]))) == []
    assert decoder.counts.good == decoder.counts.bad == 0


def test_gaps_are_counted_for_each_message():
    wire, decoder = CanWire(can_device()), framing()
    for n in range(1030):  # across the wrap of the ten bits
        for key in ("WheelEncoder.Count", "CarriageEncoder.Count"):
            data = chunk(wire.encode(key, [n]))
            if not (key == "WheelEncoder.Count" and n in (3, 4, 1023, 1024)):
                decoder.decode(data)
    assert decoder.counts.lost == 4


def test_error_frames_are_counted_and_survived():
    decoder = framing()
    assert decoder.decode(pack(ERROR | 0x40, bytes(8))) == []
    assert decoder.counts.errors == 1
    assert len(decoder.decode(chunk(CanWire(can_device()).encode("WheelEncoder.Count", [5])))) == 1


def test_message_too_short_for_its_signals_is_bad():
    decoder = framing()
    assert decoder.decode(pack(0x100, b"\x01\x02")) == []
    assert decoder.counts.bad == 1


def test_remote_and_extended_messages_of_a_wanted_id_are_not_the_wanted_ones():
    assert framing().decode(pack(0x100 | REMOTE, b"")) == []
    assert framing().decode(pack(0x100 | EXTENDED, bytes(8))) == []


def test_hostile_messages_are_survived():
    rng = random.Random(3)
    decoder = framing()
    ids = [0x100, 0x101, 0x110, 0x111, 0x112, 0x120, 0x121]
    for _ in range(20_000):
        head = rng.choice(ids) if rng.random() < 0.7 else rng.getrandbits(32)
        decoder.decode(pack(head, rng.randbytes(rng.randrange(9))))
        decoder.decode(rng.randbytes(rng.randrange(30)))
    assert decoder.counts.good + decoder.counts.bad > 10_000


def test_a_cut_chunk_is_garbage():
    decoder = framing()
    data = chunk(CanWire(can_device()).encode("WheelEncoder.Count", [5]))
    assert decoder.decode(data + data[:9])[0].values == (5,)
    assert decoder.counts.garbage == 9


# ---- inline definitions --------------------------------------------------------------------------


def test_inline_definitions_decode_like_the_dbc():
    signals = inline(
        WheelEncoder__Count={"id": 0x100, "start": 0, "length": 32},
        WheelEncoder__DeviceTime={"id": 0x100, "start": 32, "length": 22, "scale": 4.0},
        WheelEncoder__Sequence={"id": 0x100, "start": 54, "length": 10},
        SinkagePot__Volts={"id": 0x110, "start": 0, "length": 32, "is_float": True},
        MotorTemperature__Celsius={
            "id": 0x112,
            "start": 0,
            "length": 16,
            "signed": True,
            "scale": 0.01,
        },
    )
    keys = ["WheelEncoder.Count", "SinkagePot.Volts", "MotorTemperature.Celsius"]
    ours, dbc, wire = framing(keys, **signals), framing(keys), CanWire(can_device())
    for key, value in zip(keys, [(1 << 32) - 7, 1.25, -12.34], strict=True):
        data = chunk(wire.encode(key, [value], 123456))
        assert ours.decode(data)[0].values == dbc.decode(data)[0].values
    assert ours.decode(chunk(wire.encode(keys[0], [9], 40)))[0] == Frame(keys[0], 1, 40, (9,))


@pytest.mark.parametrize(
    "start, length, data, value", [(7, 16, b"\x12\x34", 0x1234), (3, 12, b"\xf2\x34", 0x234)]
)
def test_big_endian_in_the_shortest_message(start, length, data, value):
    signals = inline(
        A__Count={"id": 5, "start": start, "length": length, "byte_order": "big_endian"}
    )
    assert framing(["A.Count"], **signals).decode(pack(5, data))[0].values == (value,)


def test_extended_ids():
    signals = inline(A__Count={"id": 0x18FF0001, "start": 0, "length": 8, "extended": True})
    decoder = framing(["A.Count"], **signals)
    assert decoder.decode(pack(0x18FF0001 | EXTENDED, b"\x07"))[0].values == (7,)
    assert decoder.filters()[0]["extended"] is True


GOOD = {"id": 5, "start": 0, "length": 8}


@pytest.mark.parametrize(
    "definition, expected",
    [
        ({**GOOD, "id": 1 << 29}, "id is 536870912"),
        ({**GOOD, "id": "5"}, "id is '5'"),
        ({**GOOD, "length": 0}, "length is 0"),
        ({**GOOD, "length": True}, "length is True"),
        ({**GOOD, "is_float": True}, "32 or 64 bits for a float"),
        ({**GOOD, "scale": 0}, "scale is 0"),
        ({**GOOD, "scale": float("nan")}, "scale is nan"),
        ({**GOOD, "byte_order": "middle"}, "little_endian or big_endian"),
        ({**GOOD, "lenght": 8}, "unknown key 'lenght'"),
        ({"id": 5, "start": 0}, "length is None"),
        ({**GOOD, "start": 511, "length": 64}, "reach to byte 72"),
        ({**GOOD, "id": 0x800}, "more than 11 bits"),
    ],
)
def test_impossible_inline_definition_is_one_clear_line(definition, expected):
    with pytest.raises(DeviceSettingsError, match=expected) as error:
        framing(["A.B"], **inline(A__B=definition))
    assert "\n" not in str(error.value) and "device bus" in str(error.value)


def test_overlapping_signals_and_differing_ids_are_refused():
    with pytest.raises(DeviceSettingsError, match="overlapping"):
        framing(["A.B"], **inline(A__B=GOOD, A__C=GOOD))
    with pytest.raises(DeviceSettingsError, match="differ in id"):
        framing(["A.B"], **inline(A__B=GOOD, A__C={**GOOD, "id": 6, "start": 8}))


def test_too_many_inline_signals_are_refused():
    with pytest.raises(DeviceSettingsError, match=f"at most {MAX_INLINE}"):
        database(can_device(dbc="", signals={f"M{n}.S": GOOD for n in range(MAX_INLINE + 1)}))


def test_inline_keys_are_those_of_the_configuration():
    from gritd.estimator.config.devices import SIGNAL

    assert set(RULES) == set(SIGNAL)


# ---- what is missing or broken -------------------------------------------------------------------


@pytest.mark.parametrize(
    "key, expected",
    [
        ("Whel.Count", "no message Whel in its database; there are WheelEncoder"),
        (
            "WheelEncoder.Counts",
            "no signal WheelEncoder.Counts in its database; WheelEncoder has Count",
        ),
        ("WheelEncoder.Sequence", "no signal WheelEncoder.Sequence"),
    ],
)
def test_unknown_key_names_what_there_is(key, expected):
    with pytest.raises(DeviceSettingsError, match=expected):
        framing([key])


@pytest.mark.parametrize(
    "text, expected",
    [(None, "cannot read"), ("BO_ nonsense", "is not a DBC"), ("\0" * 99, "not a DBC")],
)
def test_broken_dbc_is_one_clear_line(tmp_path: Path, text, expected):
    path = tmp_path / "broken.dbc"
    if text is not None:
        path.write_text(text)
    with pytest.raises(DeviceSettingsError, match=expected) as error:
        database(can_device(dbc=str(path)))
    assert "broken.dbc" in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("signals", "expected"),
    [
        ('SG_ Sequence m1 : 8|8@1+ (1,0) [0|0] "" X', "Node.Sequence is multiplexed"),
        ('SG_ DeviceTime m1 : 32|24@1+ (4,0) [0|0] "us" X', "Node.DeviceTime is multiplexed"),
        ('SG_ DeviceTime : 32|32@1+ (1,0) [0|0] "us" X', "Node.DeviceTime is a float"),
    ],
)
def test_a_counter_that_is_not_an_integer_in_every_message_is_refused(
    tmp_path: Path, signals, expected
):
    path = tmp_path / "node.dbc"
    kind = "SIG_VALTYPE_ 5 DeviceTime : 1;\n" if "float" in expected else ""
    mux = 'SG_ Kind M : 0|8@1+ (1,0) [0|0] "" X\n SG_ Count m0 : 16|16@1+ (1,0) [0|0] "" X'
    path.write_text(f'VERSION ""\nBU_: X\nBO_ 5 Node: 8 X\n {mux}\n {signals}\n\n{kind}')
    with pytest.raises(
        DeviceSettingsError, match=f"{expected}; expected an integer in every message"
    ):
        framing(["Node.Count"], dbc=str(path))


def test_neither_or_both_sources_of_signals_are_refused():
    with pytest.raises(DeviceSettingsError, match="neither dbc nor signals"):
        database(can_device(dbc=""))
    with pytest.raises(DeviceSettingsError, match="both dbc and signals"):
        database(can_device(signals={"A.B": GOOD}))
