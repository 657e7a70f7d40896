"""Lines of a serial CAN adapter and messages of the kernel, beside what python-can reads."""

from __future__ import annotations

import socket
import struct

import can
import pytest
from can.interfaces.slcan import slcanBus
from hypothesis import given
from hypothesis import strategies as st

from gritd.drivers.can_link import of_kernel, packed
from gritd.drivers.port import Port
from gritd.drivers.slcan import LONGEST_LINE, SlcanLines
from tests.drivers.rig import FUZZ

LENGTHS = [*range(9), 12, 16, 20, 24, 32, 48, 64]


class Everything:
    """All identifiers."""

    def __contains__(self, can_id):
        return can_id >= 0


@st.composite
def a_message(draw):
    extended, fd = draw(st.booleans()), draw(st.booleans())
    remote = not fd and draw(st.booleans())
    size = draw(st.sampled_from(LENGTHS if fd else LENGTHS[:9]))
    return can.Message(
        arbitration_id=draw(st.integers(0, (1 << 29 if extended else 1 << 11) - 1)),
        is_extended_id=extended,
        is_fd=fd,
        bitrate_switch=fd and draw(st.booleans()),
        is_remote_frame=remote,
        dlc=size,
        data=None if remote else draw(st.binary(min_size=size, max_size=size)),
    )


def line_of(message):
    """As python-can writes it to an adapter."""
    written = []
    bus = slcanBus.__new__(slcanBus)
    bus._is_shutdown = True
    bus.serialPortOrig = type("Port", (), {"write_timeout": None})()
    bus._write = written.append
    bus.send(message)
    return written[0].encode() + b"\r"


@FUZZ
@given(st.lists(a_message(), max_size=6), st.sampled_from([b"\r", b"\r\n", b"\n"]), st.data())
def test_lines_of_python_can_give_its_messages_however_they_end_and_are_cut(messages, end, data):
    stream = b"".join(line_of(message).replace(b"\r", end) for message in messages)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=4)))
    lines = SlcanLines(Everything())
    pieces = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    decoded = [lines.decode(piece) for piece in pieces]
    assert b"".join(some for some, _ in decoded) == b"".join(map(packed, messages))
    assert sum(damaged for _, damaged in decoded) == 0 and lines.pending == 0


@FUZZ
@given(st.binary(max_size=300))
def test_any_bytes_are_taken_and_the_next_line_is_whole(junk):
    lines = SlcanLines(Everything())
    lines.decode(junk)
    lines.decode(b"\r")
    assert lines.decode(b"t10021234\r") == (struct.pack("<IB3x", 0x100, 2) + b"\x12\x34", 0)


@pytest.mark.parametrize(
    ("line", "damaged"),
    [
        (b"\xff\xfe\r", 1),
        (b"t1\r", 1),
        (b"tXYZ8\r", 1),
        (b"t1008AB\r", 1),
        (b"t1_011AA\n", 1),
        (b"hello\r\n", 1),
        (b"z\x07", 0),
        (b"V1013\r\n\r\n", 0),
    ],
)
def test_a_damaged_line_is_counted_an_answer_of_the_adapter_is_not(line, damaged):
    assert SlcanLines(Everything()).decode(line) == (b"", damaged)


def test_unwanted_messages_are_left_out():
    lines = SlcanLines(frozenset({0x100}))
    messages, damaged = lines.decode(b"t10111A\rT000001001AA\rt10011B\r")
    assert (messages[:4], len(messages), damaged) == (b"\0\1\0\0", 9, 0)


def test_a_line_that_never_ends_takes_no_memory():
    lines = SlcanLines(Everything())
    damaged = sum(lines.decode(b"\0" * 1000)[1] for _ in range(50))
    assert damaged > 0 and lines.pending <= LONGEST_LINE


@FUZZ
@given(a_message())
def test_a_message_of_the_kernel_is_packed_as_that_of_python_can(message):
    """linux/can.h: can_frame is 16 bytes, canfd_frame 72, with flags where pack has zeros."""
    flags = (1 << 31) * message.is_extended_id | (1 << 30) * message.is_remote_frame
    head = struct.pack("<IBBBB", message.arbitration_id | flags, message.dlc, 3, 0, 0)
    frame = (head + bytes(message.data)).ljust(72 if message.is_fd else 16, b"\0")
    assert of_kernel(frame) == (packed(message), 0)


def test_a_port_gives_a_datagram_at_a_time_and_silence_as_nothing():
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with ours, theirs:
        port = Port(ours.fileno())
        theirs.send(b"one")
        theirs.send(b"two")
        assert [port.read(), port.read(), port.read()] == [b"one", b"two", b""]


def test_a_port_that_hung_up_is_an_error():
    ours, theirs = socket.socketpair()
    with ours:
        theirs.close()
        with pytest.raises(OSError, match="No such device"):
            Port(ours.fileno()).read()
