"""Lines of a serial CAN adapter and messages of the kernel, beside what python-can reads."""

from __future__ import annotations

import os
import socket
import struct
import time

import can
import pytest
from can.interfaces.slcan import slcanBus
from hypothesis import given
from hypothesis import strategies as st

from gritd.drivers.build import build_readers
from gritd.drivers.can_link import of_kernel, packed
from gritd.drivers.port import Port
from gritd.drivers.queue import ReadingQueue
from gritd.drivers.slcan import LONGEST_LINE, SlcanLines
from tests.drivers.can_bus import Bus
from tests.drivers.rig import (
    FUZZ,
    Plug,
    Ticking,
    can_device,
    channel,
    wait_until,
    wiring,
)

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


# ---- a reader on a pseudo-terminal ----


@pytest.fixture
def slcan(tmp_path):
    plug = Plug(tmp_path / "slcan")
    device = can_device("slcan", str(plug.path), options={"sleep_after_open": 0.0})
    bus = Bus(device, lambda message: plug.deliver(line(message)))
    bus.plug = plug
    yield bus
    assert bus.reader.stop(2.0)
    plug.close()


def line(message):
    return f"t{message.arbitration_id:03X}{message.dlc}{message.data.hex().upper()}\r".encode()


def test_every_channel_over_slcan(slcan):
    for n in range(3):
        slcan.one_of_each(n)
    got = slcan.receive(18)
    assert [r.value for r in got if r.channel == "wheel_encoder"] == [0, 100, 200]
    assert [r.value for r in got if r.channel == "wrench"] == [(1.0, 2.0, 3.0, 0.5, 0.25, -0.5)] * 3


@pytest.mark.parametrize(
    "junk",
    [b"\xff\xfe\r", b"t1\r", b"tXYZ8\r", b"t1008AB\r", b"T\r", b"z\x07", b"t100800\xff\r", b"\r"],
)
def test_slcan_junk_costs_no_other_message(slcan, junk):
    slcan.plug.deliver(junk)
    slcan.send("WheelEncoder.Count", [5])
    assert [r.value for r in slcan.receive(1)] == [5]
    stats = slcan.reader.stats()
    assert stats.state == "OPEN" and stats.reopened == 0


def test_a_line_of_slcan_that_never_ends_is_dropped(slcan):
    """As of a wrong baud rate."""
    for _ in range(20):
        slcan.plug.deliver(b"\x00" * 1000)
        time.sleep(0.05)
    assert wait_until(lambda: slcan.reader.stats().bad > 0)
    assert wait_until(lambda: len(slcan.reader._link._direct[1].__self__._pending) <= 4096)


def test_slcan_unplugged_and_back_without_losing_a_descriptor(slcan):
    counts = []
    for _ in range(10):
        slcan.plug.unplug()
        assert wait_until(lambda: slcan.reader.stats().state == "WAITING")
        slcan.plug.plug_in()
        assert wait_until(lambda: slcan.reader.stats().state == "OPEN")
        slcan.send("SinkagePot.Volts", [1.0])
        slcan.receive(1)
        counts.append(len(os.listdir("/proc/self/fd")))
    assert len(set(counts)) == 1
    assert slcan.reader.stats().reopened == 10


@pytest.mark.parametrize("end", [b"\r", b"\r\n", b"\n"])
def test_an_adapter_of_any_line_end_is_read_and_a_strange_sender_told(tmp_path, end):
    """A drive of J1939 behind a serial adapter: it sends from another address, then as stated."""
    signals = {"Drive.Count": {"id": 0x18FEF110, "start": 0, "length": 32, "extended": True}}
    plug = Plug(tmp_path / "adapter")
    device = can_device("slcan", str(plug.path), dbc="", signals=signals)
    queue = ReadingQueue()
    (reader,) = build_readers(
        wiring([device], [channel("wheel_encoder", "bus", "Drive.Count")]), Ticking(), queue
    )
    reader.start()
    assert wait_until(lambda: reader.stats().state == "OPEN")
    plug.deliver(b"T18FEF12A8" + b"01" * 8 + end + b"nonsense" + end)
    assert wait_until(lambda: "0x18FEF12A" in reader.stats().hint)
    plug.deliver(b"".join(b"T18FEF1108%08X00000000" % n + end for n in range(50)))
    assert wait_until(lambda: reader.stats().frames == 50)
    assert reader.stats().hint == "" and reader.stats().bad == 1
    assert reader.stop(10.0)
    assert len(queue.drain()) == 50
    plug.close()
