"""Databases as they are found in the field: what is listened to is read, whatever stands beside it;
what cannot be read is one line that quotes nothing.
"""

from __future__ import annotations

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.drivers.can_signals import amiss_elsewhere, database
from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.framing_can import CanFraming, pack
from tests.drivers.rig import DBC, FUZZ, can_device

HEAD = 'VERSION ""\n\nNS_ :\n\tCM_\n\tBA_\n\nBS_:\n\nBU_: Node\n\n'
WANTED = (
    "BO_ 256 Wheel: 8 Node\n"
    ' SG_ Count : 0|32@1+ (1,0) [0|4294967295] "count" Rover\n'
    ' SG_ Sequence : 32|8@1+ (1,0) [0|255] "" Rover\n\n'
)


@pytest.fixture
def read(tmp_path):
    """The values that a database reads of message 256."""

    def of(text, keys=("Wheel.Count",), encoding="utf-8"):
        path = tmp_path / "bench.dbc"
        path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        device = can_device(dbc=str(path))
        frames = CanFraming("bus", database(device, keys), keys).decode(pack(256, bytes(range(8))))
        return [frame.values for frame in frames], amiss_elsewhere(device, keys)

    return of


@pytest.mark.parametrize(
    ("beside", "reported"),
    [
        (
            'BO_ 5 A: 2 X\n SG_ P : 0|8@1+ (1,0) [0|1] "" X\n SG_ Q : 3|1@1+ (1,0) [0|1] "" X\n',
            "signals P and Q overlap",
        ),
        ('BO_ 5 A: 2 X\n SG_ P : 12|8@1+ (1,0) [0|1] "" X\n', "beyond its 2 bytes"),
        ('BO_ 5 A: 8 X\n SG_ P : 0|8@1+ (0,0) [0|1] "" X\n', "scale 0"),
        ('BO_ 5 A: 1000000000 X\n SG_ P : 0|8@1+ (1,0) [0|1] "" X\n', "1000000000 bytes"),
        ("BO_ 5 A: 8 X\n SG_ P is a riddle\n", "no signal"),
        ("BO_ 5 A: 8 X\n\nBO_ 5 B: 8 X\n", "one id, 5"),
        ("BA_ nonsense ( ;\nVAL_ 5 ;;;\nBO_ riddle\n", ""),
        ('CM_ BO_ 5 "over\nBO_ 256 Wheel: 1 X\nseveral \\" lines";\n', ""),
        ('CM_ "that never ends\nBO_ 7 Z: 8 X\n', ""),
        ("", ""),
    ],
)
def test_what_nobody_listens_to_does_not_matter_and_is_told(read, beside, reported):
    values, amiss = read(HEAD + WANTED + beside)
    assert values == [(0x03020100,)]
    assert reported in amiss if reported else amiss == ""


@pytest.mark.parametrize(
    "disguise",
    [
        lambda text: b"\xef\xbb\xbf" + text.encode(),
        lambda text: text.replace("\n", "\r\n").encode(),
        lambda text: text.replace('"count"', '"°"').encode("cp1252"),
        lambda text: text.encode() + b'CM_ SG_ 256 Count "\xe4\x81\xff";\n',
        lambda text: text.split("BO_", 1)[1].join(["BO_", ""]).encode(),
        lambda text: text.replace(" SG_ ", "\tSG_\t").replace("(1,0)", "( 1.0 , 0.0 )").encode(),
    ],
)
def test_a_database_of_any_editor_is_read(read, disguise):
    values, amiss = read(disguise(HEAD + WANTED))
    assert values == [(0x03020100,)] and isinstance(values[0][0], int) and amiss == ""


@pytest.mark.parametrize(
    ("old", "new", "reported"),
    [
        ("Wheel: 8", "Wheel: 100000000", "100000000 bytes"),
        ("(1,0) [0|4", "(0,0) [0|4", "scale 0"),
        ("(1,0) [0|4", "(1e999,0) [0|4", "scale inf"),
        ("(1,0) [0|4", "(1,-1e999) [0|4", "offset -inf"),
        ("(1,0) [0|4", "(one,0) [0|4", "no number"),
        ("0|32@", "-5|32@", "start bit -5"),
        ("0|32@", "0|1000000000@", "1000000000 bits"),
        ("0|32@", "40|32@", "beyond its 8 bytes"),
        ("0|32@", "8|32@", "Count and Sequence overlap"),
        ("Sequence :", "Count :", "2 signals Count"),
        ("BO_ 256", "BO_ 99999", "more bits than an identifier"),
        ("\n\nBO_ 256", "\n\nBO_ 256 Other: 8 X\n\nBO_ 256", "Other and Wheel have one id"),
        ("\n\nBO_ 256", "\n\nBO_ 5 Wheel: 8 X\n\nBO_ 256", "several messages have this name"),
        ("Wheel:", "Wheels:", "did you mean Wheels"),
    ],
)
def test_what_is_listened_to_and_cannot_be_read_is_one_line(read, old, new, reported):
    with pytest.raises(DeviceSettingsError, match=reported) as error:
        read((HEAD + WANTED).replace(old, new))
    assert "bench.dbc" in str(error.value) and len(str(error.value)) <= 300


@FUZZ
@given(st.text(st.sampled_from(list('BO_SG 0123:|@+-(),[]"m\n;')), max_size=200))
def test_any_text_beside_it_is_survived(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("dbc") / "a.dbc"
    path.write_text(HEAD + WANTED + text)
    device = can_device(dbc=str(path))
    try:
        assert [m.name for m in database(device, ["Wheel.Count"]).messages] == ["Wheel"]
        amiss_elsewhere(device, ["Wheel.Count"])
    except DeviceSettingsError as error:  # the text belongs to the wanted message, or repeats it
        assert "\n" not in str(error)


def test_what_is_no_database_is_not_quoted(tmp_path):
    secret = tmp_path / "shadow"
    secret.write_text("root:$6$secret:19000:0:99999:7:::\n")
    with pytest.raises(DeviceSettingsError, match="not a DBC file") as error:
        database(can_device(dbc=str(secret)), ["A.B"])
    assert "secret" not in str(error.value)


def test_a_pipe_or_a_device_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", "/dev/zero"):
        with pytest.raises(DeviceSettingsError, match="no regular file"):
            database(can_device(dbc=str(path)), ["A.B"])


def test_multiplexed_signals_of_the_wanted_message_are_read(read):
    text = (
        "BO_ 256 Wheel: 8 Node\n"
        ' SG_ Kind M : 0|8@1+ (1,0) [0|0] "" X\n'
        ' SG_ Count m0 : 8|16@1+ (1,0) [0|0] "" X\n'
        ' SG_ Volts m1 : 8|16@1+ (1,0) [0|0] "" X\n'
    )
    assert read(HEAD + text)[0] == [(0x0201,)]


def test_the_packaged_database_is_read_as_cantools_reads_it():
    import cantools

    whole = cantools.database.load_file(DBC)
    for message in database(can_device()).messages:
        other = whole.get_message_by_name(message.name)
        data = bytes(range(1, message.length + 1))
        assert message.decode(data) == other.decode(data)
