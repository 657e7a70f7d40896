"""A CAN bus that fails, lies or floods, on real sockets of the loopback."""

from __future__ import annotations

import random
import socket
import time
from dataclasses import replace
from threading import Event

import can
import pytest

from gritd.drivers.build import build_decoder
from gritd.drivers.can_link import CanLink
from gritd.drivers.errors import DeviceError
from gritd.drivers.queue import ReadingQueue
from gritd.drivers.reader import Reader
from gritd.estimator.config.settings import Device
from gritd.tools.testbed.wires import has_multicast
from tests.drivers.rig import Ticking
from tests.scenarios.recorded import rows, verified
from tests.scenarios.rig import TESTBED, WIRES, driven, service

FAILING = "CAN error frame or failing bus"
HOSTILE = "hostile CAN or UDP datagram"
FLOOD = "bus flood"
UNWANTED = 0x7F0
WAITING = 50_000  # [bytes] in the socket before a sender waits

multicast = pytest.mark.skipif(not has_multicast(), reason="no interface takes multicast")


def test_a_bus_that_goes_away_and_comes_back(tmp_path, seed, figure):
    """A serial CAN adapter (slcan) that is pulled out and put back."""
    rng = random.Random(seed)
    with service(tmp_path, driven(40.0, seed, skip=2.0), bus="slcan") as (wires, daemon):
        daemon.wait_status(lambda report: report["status"] == "TRACKING")
        time.sleep(rng.uniform(0.0, 0.3))
        wires.bus.plug.unplug()
        daemon.heard("device bus WAITING")
        time.sleep(rng.uniform(0.0, 0.5))
        wires.bus.plug.plug_in()
        back = time.monotonic()
        daemon.heard("device bus OPEN", 2)
        figure(
            FAILING,
            WIRES,
            "back after the adapter was put back",
            time.monotonic() - back,
            "s",
            5.5,
            real=True,
        )
        daemon.wait_status(lambda report: report["status"] == "TRACKING")
        daemon.stop()
    assert verified(daemon.path())


def daemon_ids():
    """The ids the daemon asks the bus for."""
    framing = build_decoder(TESTBED.settings, TESTBED.settings.devices["bus"]).framing
    return [int(given["can_id"]) for given in framing.filters()]


@multicast
def test_error_frames_are_counted_and_survived(tmp_path, seed, figure):
    """python-can filters this bus itself and takes an error frame for a message: so they carry a
    wanted id.
    """
    frames, wanted = 50, daemon_ids()[0]
    with service(tmp_path, driven(40.0, seed, skip=2.0), bus="udp_multicast") as (wires, daemon):
        daemon.wait_status(lambda report: report["status"] == "TRACKING")
        for _ in range(frames):
            wires.bus._bus.send(
                can.Message(is_error_frame=True, arbitration_id=wanted, is_extended_id=False)
            )
            time.sleep(0.005)
        arrived = frames - dropped(wires, daemon)
        report = daemon.wait_status(lambda report: report["devices"]["bus"]["errors"] >= arrived)
        figure(
            FAILING,
            WIRES,
            "error frames not counted",
            arrived - report["devices"]["bus"]["errors"],
            "",
            0,
        )
        daemon.wait_status(lambda report: report["status"] == "TRACKING")
        daemon.stop()
    assert verified(daemon.path())


def dropped(wires, daemon):
    """Datagrams the kernel threw away before the daemon could read them, on a computer that was too
    slow.
    """
    return daemon.datagrams(wires.bus.device.options["port"])[1]


@multicast
def test_hostile_datagrams(tmp_path, seed, figure):
    """33,400 datagrams a seed, 1e5 in all: random bytes, and damaged copies of a real message."""
    rng = random.Random(seed)
    cases = 33_400
    with service(tmp_path, bus="udp_multicast") as (wires, daemon):
        address = (wires.bus.device.channel, wires.bus.device.options["port"])
        threads = daemon.threads()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
            for number in range(cases):
                out.sendto(hostile(rng), address)
                while number % 20 == 0 and daemon.datagrams(address[1])[0] > WAITING:
                    time.sleep(0.001)
        wires.play(driven(40.0, seed, skip=2.0))
        report = daemon.wait_status(lambda report: report["status"] == "TRACKING")
        counted = report["devices"]["bus"]["bad"] + report["devices"]["bus"]["unknown"]
        figure(HOSTILE, WIRES, "datagrams sent", cases, "")
        figure(HOSTILE, WIRES, "threads lost", threads - daemon.threads(), "", 0)
        figure(
            HOSTILE,
            WIRES,
            "times the bus had to be reopened",
            report["devices"]["bus"]["reopened"],
            "",
            0,
        )
        assert counted > 0.9 * (cases - dropped(wires, daemon)), f"{counted} of {cases} counted"
        daemon.stop()
    assert verified(daemon.path())


def hostile(rng):
    """Random bytes; or msgpack of a message with wrong parts."""
    if rng.random() < 0.5:
        return rng.randbytes(rng.randrange(1, 200))
    good = bytearray(GOOD)
    for _ in range(rng.randrange(1, 6)):
        good[rng.randrange(len(good))] = rng.randrange(256)
    return bytes(good)


def good_datagram():
    from can.interfaces.udp_multicast.utils import pack_message

    return bytes(
        pack_message(can.Message(arbitration_id=0x101, data=bytes(8), is_extended_id=False))
    )


GOOD = good_datagram()


@multicast
@pytest.mark.parametrize(("rate", "seconds"), [(5_000, 3.0), (12_000, 1.0)])
def test_bus_flood(tmp_path, seed, rate, seconds, figure):
    """Unwanted frames between the wanted ones: paced, none of those is lost; in a burst every loss
    is counted.
    """
    with service(tmp_path, driven(40.0, seed, skip=2.0), bus="udp_multicast") as (wires, daemon):
        daemon.wait_status(lambda report: report["status"] == "TRACKING")
        sent = flood(wires.bus._bus, rate, seconds)
        time.sleep(0.5)
        lost, no_room = daemon.status()["devices"]["bus"]["lost"], dropped(wires, daemon)
        daemon.stop()
    gaps = missing_samples(rows(daemon.path(), "/raw/sinkage_pot")["stamp"])
    name = f"wanted frames lost at {rate / 1000:g} k unwanted frames/s"
    figure(
        FLOOD,
        WIRES,
        f"unwanted frames really sent, of {rate / 1000:g} k/s",
        sent / seconds / 1000,
        "k/s",
    )
    figure(FLOOD, WIRES, name, lost, "", 0 if rate <= 5000 else None, real=True)
    figure(FLOOD, WIRES, f"{name} without the kernel's doing", max(lost - no_room, 0), "", 0)
    assert gaps <= max(lost, no_room), f"{gaps} samples missing, {lost} frames counted as lost"
    assert verified(daemon.path())


def flood(bus, rate, seconds):
    """Frames of an id that nobody wants, in packets of 5 ms; time that the sender lost is not made
    up for. How many.
    """
    message = can.Message(arbitration_id=UNWANTED, data=bytes(8), is_extended_id=False)
    end, before, due, sent = time.monotonic() + seconds, time.monotonic(), 0.0, 0
    while (now := time.monotonic()) < end:
        due, before = due + min(now - before, 0.02) * rate, now
        while due >= 1.0:
            bus.send(message)
            due, sent = due - 1.0, sent + 1
        time.sleep(0.005)
    return sent


def missing_samples(stamps):
    """Samples of a 250 Hz channel that are not there, between the first and the last."""
    return max(0, round((stamps[-1] - stamps[0]) * 1e-9 * 250) + 1 - len(stamps))


class Raising:
    """A bus whose recv raises."""

    def __init__(self, error):
        self.error = error

    def recv(self, timeout):
        raise self.error

    def shutdown(self):
        raise can.CanError("gone")


FAILURES = [OSError(100, "Network is down"), can.CanOperationError("bus off"), RuntimeError("x")]


@pytest.mark.parametrize("error", FAILURES)
def test_a_bus_whose_recv_raises_is_one_device_error(error, figure):
    link = CanLink(Device("bus", "can"), [], Ticking())
    link._bus = Raising(error)
    with pytest.raises(DeviceError, match=r"^bus: cannot read can0"):
        link.read()
    link.close()
    figure(
        FAILING,
        "CAN link, bus-off simulated by a bus that raises",
        "exceptions that reach the reader",
        0,
        "",
        0,
    )


class Quiet:
    """A bus on which nothing is said."""

    def recv(self, timeout):
        time.sleep(timeout)

    def shutdown(self):
        pass


@pytest.mark.parametrize("error", FAILURES)
def test_a_bus_that_raises_is_opened_again(error, monkeypatch, figure):
    """Half a second long every bus that is opened fails; then one does not."""
    works, back, failed = time.monotonic() + 0.5, Event(), []

    def bus(*_, **__):
        if time.monotonic() < works or not failed:
            failed.append(error)
            return Raising(error)
        back.set()
        return Quiet()

    monkeypatch.setattr(can, "Bus", bus)
    device = TESTBED.settings.devices["bus"]
    link = CanLink(replace(device, interface="socketcan", channel="can0"), [], time.time_ns)
    reader = Reader("bus", link, build_decoder(TESTBED.settings, device), ReadingQueue())
    reader.start()
    assert back.wait(60.0)
    took = time.monotonic() - works
    assert reader.alive and reader.stop(60.0) and reader.stats().reopened >= 1
    level = "reader and CAN link, bus-off simulated by a bus that raises"
    figure(FAILING, level, "back after the bus worked again", took, "s", 5.5, real=True)
