"""Readers on CAN buses that need no hardware: udp_multicast on loopback, slcan over a
pseudo-terminal, virtual.

True bus-off and a vanishing controller cannot be brought about without hardware; a bus whose recv
raises stands in.
"""

from __future__ import annotations

import random
import socket
import time

import can
import pytest

from gritd.drivers import can_link
from gritd.drivers.build import build_readers
from gritd.drivers.can_link import CanLink, packed
from gritd.drivers.can_signals import database
from gritd.drivers.errors import DeviceError
from gritd.drivers.framing_can import CanFraming
from gritd.drivers.queue import ReadingQueue
from gritd.drivers.wire import CanWire
from tests.drivers.can_bus import Bus, all_channels
from tests.drivers.rig import (
    Ticking,
    can_device,
    wait_until,
    wiring,
)

GROUP = "239.74.163.77"


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture
def virtual():
    sender = can.Bus("gritd test", "virtual", ignore_config=True)
    bus = Bus(can_device("virtual", "gritd test"), sender.send)
    yield bus
    assert bus.reader.stop(2.0)
    sender.shutdown()


@pytest.fixture
def multicast():
    pytest.importorskip("msgpack", reason="python-can's udp_multicast needs msgpack")
    options = {"port": free_port(), "hop_limit": 0}
    device = can_device("udp_multicast", GROUP, options=options)
    try:
        sender = can.Bus(GROUP, "udp_multicast", ignore_config=True, **options)
    except can.CanInitializationError as error:
        pytest.skip(f"no multicast on this machine: {error.__cause__ or error}")
    bus = Bus(device, sender.send)
    bus.options = options
    yield bus
    assert bus.reader.stop(2.0)
    sender.shutdown()


@pytest.mark.parametrize("kind", ["virtual", "multicast"])
def test_every_channel_over_a_bus(kind, request):
    bus = request.getfixturevalue(kind)
    for n in range(5):
        bus.one_of_each(n)
    got = bus.receive(30)
    values = {
        name: [r.value for r in got if r.channel == name] for name in {r.channel for r in got}
    }
    wheel, carriage = values["wheel_encoder"], values["carriage_encoder"]
    assert wheel == [0, 100, 200, 300, 400]
    assert [count - carriage[0] for count in carriage] == [0, -7, -14, -21, -28]
    assert values["sinkage_pot"] == [1.5] * 5 and values["motor_shunt"] == [2.5] * 5
    assert values["motor_temperature"] == [25.5] * 5
    assert values["wrench"] == [(1.0, 2.0, 3.0, 0.5, 0.25, -0.5)] * 5
    assert all(r.stamp <= r.received for r in got)
    assert bus.reader.stats().lost == bus.reader.stats().incomplete == 0


def test_unwanted_ids_do_not_pass_the_bus(virtual):
    for other in (0x0FF, 0x102, 0x123, 0x7FF):
        virtual.sender(can.Message(arbitration_id=other, data=bytes(8), is_extended_id=False))
    virtual.sender(can.Message(arbitration_id=0x100, data=bytes(8), is_extended_id=True))
    virtual.send("WheelEncoder.Count", [1])
    virtual.receive(1)
    assert virtual.reader.stats().bytes == 16  # one message of eight bytes and its head


def test_error_frames_are_counted_and_survived(virtual):
    for _ in range(3):
        virtual.sender(
            can.Message(
                arbitration_id=0x100, data=bytes(8), is_extended_id=False, is_error_frame=True
            )
        )
    virtual.send("WheelEncoder.Count", [1])
    virtual.receive(1)
    assert virtual.reader.stats().errors == 3 and virtual.reader.stats().state == "OPEN"


def test_impossible_values_are_quarantined(virtual):
    for volts in (float("nan"), float("inf"), -0.1, 5.1):
        virtual.send("SinkagePot.Volts", [volts])
    virtual.send("WrenchForce", [600.0, 0.0, 0.0])
    virtual.send("WrenchTorque", [0.0, 0.0, 0.0])
    virtual.send("WheelEncoder.Count", [1])
    assert [r.channel for r in virtual.receive(1)] == ["wheel_encoder"]
    assert virtual.reader.stats().quarantined == 5


def test_a_lost_half_of_the_wrench_is_counted_not_mixed(virtual):
    virtual.send("WrenchForce", [1.0, 0.0, 0.0])
    virtual.wire.encode("WrenchTorque", [0.0, 0.0, 0.0])  # never sent
    virtual.send("WrenchForce", [2.0, 0.0, 0.0])
    virtual.send("WrenchTorque", [0.0, 0.0, 0.0])
    assert [r.value[0] for r in virtual.receive(1)] == [2.0]
    assert virtual.reader.stats().incomplete == 1


# ---- floods --------------------------------------------------------------------------------------


def unwanted(n):
    return can.Message(arbitration_id=0x200 + n % 0x300, data=bytes(8), is_extended_id=False)


def test_paced_flood_of_unwanted_ids_loses_no_wanted_frame(multicast):
    """Unwanted messages at about 5000 a second, a wanted one among every twenty; lost time is not
    made up for.
    """
    start = time.monotonic()
    for n in range(5000):
        start = max(start, time.monotonic() - n / 5000 - 0.01)
        multicast.sender(unwanted(n))
        if n % 20 == 0:
            multicast.send("WheelEncoder.Count", [n], time.monotonic_ns() // 1000)
        time.sleep(max(0.0, start + n / 5000 - time.monotonic()))
    got = multicast.receive(250)
    assert [r.value for r in got] == list(range(0, 5000, 20))
    stats = multicast.reader.stats()
    assert (stats.frames, stats.lost, stats.bad) == (250, 0, 0)


def test_burst_loses_nothing_uncounted(multicast):
    """As fast as the sender can; what the kernel could not hold shows as a gap of the sequence."""
    multicast.send("WheelEncoder.Count", [0])
    multicast.receive(1)
    for n in range(3000):
        multicast.sender(unwanted(n))
        if n % 20 == 0:
            multicast.send("WheelEncoder.Count", [1])
    sent = 1 + 150

    def the_end_arrives() -> bool:
        nonlocal sent
        sent += 1
        multicast.send("WheelEncoder.Count", [1000 + sent])
        time.sleep(0.02)
        return any(reading.value == 1000 + sent for reading in multicast.queue.drain())

    assert wait_until(the_end_arrives)
    stats = multicast.reader.stats()
    assert stats.frames + stats.lost == sent
    print(f"burst: {stats.frames} received, {stats.lost} lost and counted")


# ---- hostile input -------------------------------------------------------------------------------


def hostile_datagrams(rng, count):
    """Random bytes, and real messages with random damage."""
    from can.interfaces.udp_multicast.utils import pack_message

    real = pack_message(can.Message(arbitration_id=0x100, data=bytes(8), is_extended_id=False))
    for _ in range(count):
        if rng.random() < 0.5:
            yield rng.randbytes(rng.randrange(1, 100))
        else:
            at = rng.randrange(len(real))
            yield real[:at] + rng.randbytes(rng.randrange(3)) + real[at + 1 :]


def shout(multicast, datagrams):
    """Send raw datagrams to the group, slowly enough for the kernel's buffer."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as raw:
        raw.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        for n, datagram in enumerate(datagrams):
            raw.sendto(datagram, (GROUP, multicast.options["port"]))
            if n % 50 == 49:
                time.sleep(0.005)


@pytest.mark.parametrize("count", [3000, pytest.param(100_000, marks=pytest.mark.long)])
def test_hostile_datagrams_are_counted_and_ignored(multicast, count):
    shout(multicast, hostile_datagrams(random.Random(6), count))

    def an_intact_one_arrives() -> bool:
        multicast.send("SinkagePot.Volts", [1.25])
        time.sleep(0.01)
        return any(reading.value == 1.25 for reading in multicast.queue.drain())

    assert wait_until(an_intact_one_arrives)
    stats = multicast.reader.stats()
    assert stats.state == "OPEN" and stats.reopened == 0 and stats.last_error == ""
    assert stats.bad > count / 3


# ---- a failing bus -------------------------------------------------------------------------------


class FailingBus:
    """A bus that delivers one message, then fails."""

    opened = 0
    closed = 0

    def __init__(self, error, message) -> None:
        FailingBus.opened += 1
        self.error, self.message = error, message

    def recv(self, timeout):
        message, self.message = self.message, None
        if message is None:
            raise self.error
        return message

    def shutdown(self):
        FailingBus.closed += 1
        raise can.CanOperationError("cannot be told to stop")


@pytest.mark.parametrize(
    "error",
    [
        can.CanOperationError("bus off"),
        OSError(100, "Network is down"),
        RuntimeError("backend"),
        ValueError("x"),
    ],
)
def test_a_bus_whose_recv_raises_is_reopened(monkeypatch, error):
    device = can_device("socketcan", "can0")
    wire = CanWire(device)
    FailingBus.opened = FailingBus.closed = 0
    monkeypatch.setattr(
        can_link.can,
        "Bus",
        lambda *_, **__: FailingBus(error, wire.encode("SinkagePot.Volts", [1.0])),
    )
    queue = ReadingQueue()
    (reader,) = build_readers(wiring([device], all_channels()), Ticking(), queue)
    reader.start()
    assert wait_until(lambda: reader.stats().reopened >= 2)
    assert reader.alive and reader.stats().last_error.startswith("bus: cannot read can0: ")
    assert reader.stop(2.0)
    assert queue.counts().received >= 2
    assert FailingBus.closed == FailingBus.opened


def test_a_missing_bus_is_one_clear_line_and_retried():
    """socketcan without such an interface, or without the kernel's CAN support."""
    device = can_device("socketcan", "nocan9")
    (reader,) = build_readers(wiring([device], all_channels()), Ticking(), ReadingQueue())
    reader.start()
    assert wait_until(lambda: reader.stats().last_error)
    stats = reader.stats()
    assert (
        stats.last_error.startswith("bus: cannot open socketcan nocan9: ")
        and "\n" not in stats.last_error
    )
    assert stats.state == "WAITING" and reader.stop()


def test_reading_a_link_that_is_not_open_is_a_device_error():
    with pytest.raises(DeviceError, match=r"^bus: test is not open"):
        CanLink(can_device(), [], Ticking()).read()


def test_socketcan_gets_the_filters_and_ignores_configuration_files(monkeypatch):
    asked = {}
    monkeypatch.setattr(
        can_link.can,
        "Bus",
        lambda *args, **kwargs: asked.update(kwargs, args=args) or FailingBus(None, None),
    )
    device = can_device("socketcan", "can3", bitrate=250_000, options={"local_loopback": False})
    framing = CanFraming("bus", database(device), ["WheelEncoder.Count"])
    CanLink(device, framing.filters(), Ticking()).open()
    assert asked["args"] == ("can3", "socketcan") and asked["ignore_config"] is True
    assert asked["can_filters"] == [{"can_id": 0x100, "can_mask": 0x1FFFFFFF, "extended": False}]
    assert asked["bitrate"] == 250_000 and asked["local_loopback"] is False


def test_a_message_that_contradicts_itself_is_refused():
    with pytest.raises(ValueError, match="length"):
        packed(can.Message(arbitration_id=1, dlc=8, data=b"123"))
