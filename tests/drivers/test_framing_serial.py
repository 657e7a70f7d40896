"""Both serial framings: what is sent arrives, damage costs at most one more frame, every byte is
accounted for.
"""

from __future__ import annotations

import math
import random
import re
import struct
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gritd.drivers import framing_ascii, framing_cobs
from gritd.drivers.framing import MAX_VALUES, Frame
from gritd.drivers.framing_ascii import AsciiFraming
from gritd.drivers.framing_cobs import CobsFraming
from tests.drivers.rig import FUZZ, damage

FRAMINGS = [
    pytest.param(framing_ascii.encode, AsciiFraming, id="ascii"),
    pytest.param(framing_cobs.encode, CobsFraming, id="cobs"),
]
both = pytest.mark.parametrize("encode, framing", FRAMINGS)

KEYS = st.text("abcdefghijklmnopqrstuvwxyzABCXYZ0123456789_.-", min_size=1, max_size=16)
INTEGERS = st.lists(st.integers(-(1 << 63), (1 << 63) - 1), min_size=1, max_size=8)
FLOATS = st.lists(st.floats(), min_size=1, max_size=8)
FRAMES = st.builds(
    Frame,
    KEYS,
    st.integers(0, 0xFFFF),
    st.none() | st.integers(0, (1 << 32) - 1),
    (INTEGERS | FLOATS).map(tuple),
)


def same(sent: Frame, got: Frame) -> bool:
    """Equal to the bit, NaN and the sign of zero included."""
    return sent[:3] == got[:3] and list(map(exact, sent.values)) == list(map(exact, got.values))


def exact(value):
    if isinstance(value, float):
        return "nan" if math.isnan(value) else struct.pack("d", value)
    return value


def stream(encode, count, seed=0):
    """Numbered frames of several keys with random values, and their bytes."""
    rng = random.Random(seed)
    frames = [
        Frame(
            rng.choice(["wheel", "pot"]),
            n % 65536,
            rng.randrange(1 << 32),
            (rng.randrange(1 << 32),),
        )
        for n in range(count)
    ]
    return frames, [encode(frame) for frame in frames]


@both
@FUZZ
@given(st.lists(FRAMES, max_size=6), st.randoms(use_true_random=False))
@example([Frame("k", 0, 0, (0,))], random.Random(0))
@example([Frame("k", 0xFFFF, None, (0.0, -0.0, math.nan, math.inf))], random.Random(0))
def test_frames_arrive_unchanged_however_the_bytes_are_cut(encode, framing, frames, rng):
    data = b"".join(map(encode, frames))
    decoder = framing()
    got = []
    at = 0
    while at < len(data):
        step = rng.randint(1, 40)
        got += decoder.decode(data[at : at + step])
        at += step
    assert len(got) == len(frames) and all(map(same, frames, got))
    assert (decoder.counts.good, decoder.counts.bad, decoder.counts.garbage) == (len(frames), 0, 0)


@both
@FUZZ
@given(st.lists(st.binary(max_size=700), max_size=8))
@example([b"$" * 600, b"\0" * 600])
@example([b"\x01" * 5000])
def test_any_bytes_are_survived_counted_and_forgotten(encode, framing, chunks):
    decoder = framing()
    for chunk in chunks:
        assert decoder.decode(chunk) == []
        assert decoder.pending <= max(framing_ascii.MAX_LINE, framing_cobs.MAX_STUFFED)
    assert decoder.counts.garbage + decoder.pending == sum(map(len, chunks))


@both
def test_a_fault_costs_the_frames_it_touches_and_at_most_one_more(encode, framing):
    rng = random.Random(1)
    frames, pieces = stream(encode, 12)
    data = b"".join(pieces)
    ends = [sum(map(len, pieces[: n + 1])) for n in range(len(pieces))]
    for _ in range(4000):
        at = rng.randrange(len(data))
        touched = sum(
            1
            for end, piece in zip(ends, pieces, strict=True)
            if end > at and end - len(piece) < at + 3
        )
        hurt = damage(rng, data, at)
        decoder = framing()
        got = decoder.decode(hurt)
        assert all(frame in frames for frame in got)
        assert len(got) >= len(frames) - touched - 1
        accounted = (
            sum(len(encode(frame)) for frame in got) + decoder.counts.garbage + decoder.pending
        )
        # a line is good without its line end, too
        assert len(hurt) <= accounted <= len(hurt) + 2


@pytest.mark.long
@both
def test_a_million_damaged_bytes(encode, framing):
    rng = random.Random(2)
    frames, pieces = stream(encode, 50_000)
    sent = set(frames)
    decoder = framing()
    wrong = 0
    faults = 0
    for piece in pieces:
        if rng.random() < 0.1:
            piece = damage(rng, piece, rng.randrange(len(piece)))
            faults += 1
        wrong += sum(frame not in sent for frame in decoder.decode(piece))
    assert wrong <= 2  # a CRC-16 lets one damaged frame in 65536 through
    assert decoder.counts.good >= len(frames) - 2 * faults


@both
def test_truncated_frame_then_intact_ones(encode, framing):
    frames, pieces = stream(encode, 3)
    for cut in range(len(pieces[0])):
        got = framing().decode(pieces[0][:cut] + pieces[1] + pieces[2])
        assert got[-1] == frames[2]
        assert len(got) >= 1


@both
def test_starting_in_the_middle_of_a_frame(encode, framing):
    frames, pieces = stream(encode, 2)
    for cut in range(1, len(pieces[0])):
        got = framing().decode(pieces[0][cut:] + pieces[1])
        assert frames[1] in got and len(got) == 1


@both
def test_gaps_are_counted_across_the_wrap(encode, framing):
    decoder = framing()
    numbers = [65533, 65534, 1, 2, 10]  # 65535 and 0 are missing, then 3 to 9
    for number in numbers:
        decoder.decode(encode(Frame("k", number, None, (1,))))
    assert decoder.counts.lost == 2 + 7


@both
def test_a_device_that_starts_anew_is_no_loss(encode, framing):
    decoder = framing()
    for number in [5000, 5001, 0, 1]:
        decoder.decode(encode(Frame("k", number, None, (1,))))
    assert decoder.counts.lost == 0


@both
def test_reset_forgets_the_unfinished_frame(encode, framing):
    frames, pieces = stream(encode, 2)
    decoder = framing()
    decoder.decode(pieces[0][:-3])
    decoder.reset()
    assert decoder.decode(pieces[1]) == [frames[1]]
    assert decoder.counts.lost == 0 and decoder.counts.garbage == len(pieces[0]) - 3


@both
@pytest.mark.parametrize("count", [0, MAX_VALUES + 1])
def test_frames_without_values_or_with_too_many_are_bad(encode, framing, count):
    decoder = framing()
    if count == 0 and encode is framing_cobs.encode:
        data = encode(Frame("k", 0, None, ()), "i")
    else:
        data = encode(Frame("k", 0, None, (1,) * count))
    assert decoder.decode(data) == [] and decoder.counts.bad == 1


def test_ascii_line_as_documented():
    line = framing_ascii.encode(Frame("wheel", 7, 1234, (-5, 0.25)))
    assert line.startswith(b"$wheel,7,1234,-5,0.25*") and line.endswith(b"\r\n")
    assert AsciiFraming().decode(line) == [Frame("wheel", 7, 1234, (-5, 0.25))]


def ascii_line(body: bytes) -> bytes:
    return b"$%b*%04X\r\n" % (body, framing_ascii.crc_hqx(body, 0xFFFF))


@pytest.mark.parametrize(
    "body",
    [
        b"k,70000,,1", b"k,-1,,1", b"k,1,4294967296,1", b"k,1,,1_0", b"k,1,, 1", b"k,1,,",
        b"k,1,,0x10", b"k,1,,--1", b",1,,1", b"k k,1,,1", b"k,1", b"k,,,1", b"k,1,," + b"9" * 40,
        b"k\xff,1,,1", b"k,1,,Infinity",
    ],
)  # fmt: skip
def test_ascii_content_that_is_no_frame_is_bad_in_spite_of_its_checksum(body):
    decoder = AsciiFraming()
    assert decoder.decode(ascii_line(body)) == []
    assert decoder.counts.bad == 1


def test_cobs_bytes_as_documented():
    body = struct.pack("<HBB5sIi", 1, ord("i"), 5 | 0x80, b"wheel", 1000, -2)
    body += struct.pack("<H", framing_cobs.crc_hqx(body, 0xFFFF))
    data = framing_cobs.encode(Frame("wheel", 1, 1000, (-2,)))
    assert data.count(0) == 1 and data[-1] == 0
    assert framing_cobs._unstuff(data[:-1]) == body


@pytest.mark.parametrize(
    "kind, value", [("i", -5), ("I", 1 << 31), ("q", -1 << 40), ("f", 0.5), ("d", 0.1)]
)
def test_cobs_kinds_of_value(kind, value):
    assert CobsFraming().decode(framing_cobs.encode(Frame("k", 0, 0, (value,)), kind))[
        0
    ].values == (value,)


def test_cobs_frame_too_long_is_refused_when_sent():
    with pytest.raises(ValueError, match="at most 253"):
        framing_cobs.encode(Frame("k", 0, None, (0.5,) * 40))


def test_the_line_in_the_documentation_is_right():
    page = (Path(__file__).parents[2] / "docs" / "adding-a-sensor.md").read_text()
    line = re.search(r"`(\$pot,[^`]*)`", page)[1]
    assert AsciiFraming().decode(line.encode() + b"\r\n") == [Frame("pot", 17, 1234567, (2.4961,))]
