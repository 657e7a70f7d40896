"""Readers on a pseudo-terminal with the real pyserial: data, garbage, unplugging, stopping."""

from __future__ import annotations

import os
import random
import threading
import time

import pytest

from gritd.drivers.build import build_readers
from gritd.drivers.errors import DeviceError
from gritd.drivers.link import Chunk
from gritd.drivers.queue import ReadingQueue
from gritd.drivers.reader import BACKOFF_FIRST, BACKOFF_LAST, Reader
from gritd.drivers.serial_link import SerialLink
from gritd.drivers.wire import SerialWire
from tests.drivers.rig import Plug, Ticking, channel, serial_device, wait_until, wiring

CHANNELS = [
    channel("wheel_encoder", "encoders"),
    channel("sinkage_pot", "encoders", low=0.0, high=5.0),
]


class Rig:
    """A reader on a plug."""

    def __init__(self, path, framing="cobs") -> None:
        device = serial_device(path, framing)
        self.plug = Plug(path)
        self.wire = SerialWire(device)
        self.queue = ReadingQueue()
        (self.reader,) = build_readers(wiring([device], CHANNELS), Ticking(), self.queue)

    def open(self):
        self.reader.start()
        assert wait_until(lambda: self.reader.stats().state == "OPEN")

    def send(self, count, device_us=None):
        self.plug.deliver(self.wire.encode("wheel_encoder", [count], device_us))

    def receive(self, readings):
        got = []
        assert wait_until(
            lambda: len(got) >= readings or got.extend(self.queue.drain()) or len(got) >= readings
        )
        return got

    def close(self):
        assert self.reader.stop(2.0)
        self.plug.close()


@pytest.fixture(params=["cobs", "ascii"])
def rig(tmp_path, request):
    rig = Rig(tmp_path / "tty", request.param)
    yield rig
    rig.close()


def test_values_arrive_stamped_and_in_order(rig):
    rig.open()
    for n in range(20):
        rig.send(n, 1000 * n)
        rig.plug.deliver(rig.wire.encode("sinkage_pot", [0.1 * n], 1000 * n))
    got = rig.receive(40)
    assert [r.value for r in got if r.channel == "wheel_encoder"] == list(range(20))
    assert [r.value for r in got if r.channel == "sinkage_pot"] == [0.1 * n for n in range(20)]
    assert all(r.stamp <= r.received for r in got)
    wheel = [r.stamp for r in got if r.channel == "wheel_encoder"]
    assert wheel == sorted(set(wheel))
    stats = rig.reader.stats()
    assert (stats.frames, stats.bad, stats.garbage, stats.lost, stats.readings) == (40, 0, 0, 0, 40)


def test_without_device_time_the_stamp_is_the_receive_time(rig):
    rig.open()
    rig.send(1)
    (reading,) = rig.receive(1)
    assert reading.stamp == reading.received


def test_garbage_bad_values_duplicates_and_strangers_are_counted(rig):
    rig.open()
    rig.plug.deliver(random.Random(4).randbytes(300) + b"\n\0")
    rig.send(5, 100)
    rig.plug.deliver(rig.wire.encode("sinkage_pot", [float("nan")], 200))
    rig.plug.deliver(rig.wire.encode("sinkage_pot", [5.1], 300))
    rig.plug.deliver(rig.wire.encode("stranger", [1], 300))
    twice = rig.wire.encode("wheel_encoder", [6], 400)
    rig.plug.deliver(twice + twice)
    assert [r.value for r in rig.receive(2)] == [5, 6]
    assert wait_until(lambda: rig.reader.stats().frames == 6)
    stats = rig.reader.stats()
    assert (stats.quarantined, stats.duplicates, stats.unknown, stats.lost) == (2, 1, 1, 0)
    assert stats.garbage >= 300 and stats.readings == 2


def fill(rig, number):
    rig.send(number)
    (reading,) = rig.receive(1)
    return reading.value


def descriptors():
    return len(os.listdir("/proc/self/fd"))


def test_unplugged_and_back_many_times_without_losing_a_descriptor(tmp_path):
    rig = Rig(tmp_path / "tty")
    rig.open()
    before = descriptors()
    noticed, back = [], []
    for cycle in range(10):
        assert (
            fill(rig, cycle) == 0
        )  # the encoder's total does not jump, whatever the device counts
        start = time.monotonic()
        rig.plug.unplug()
        assert wait_until(lambda: rig.reader.stats().state == "WAITING")
        noticed.append(time.monotonic() - start)
        rig.plug.plug_in()
        start = time.monotonic()
        assert wait_until(lambda: rig.reader.stats().state == "OPEN")
        back.append(time.monotonic() - start)
    assert descriptors() <= before
    assert rig.reader.stats().reopened == 10
    assert "tty" in rig.reader.stats().last_error
    print(
        f"noticed within {max(noticed) * 1e3:.1f} ms,"
        f" back within {max(back) * 1e3:.0f} ms of plugging in"
    )
    rig.close()


@pytest.mark.long
def test_a_hundred_unpluggings(tmp_path):
    rig = Rig(tmp_path / "tty")
    rig.open()
    before = descriptors()
    for cycle in range(100):
        fill(rig, cycle)
        rig.plug.unplug()
        assert wait_until(lambda: rig.reader.stats().state == "WAITING")
        rig.plug.plug_in()
        assert wait_until(lambda: rig.reader.stats().state == "OPEN")
    assert descriptors() <= before and rig.reader.stats().reopened == 100
    rig.close()


def test_an_encoder_keeps_its_total_over_an_unplugging(rig):
    rig.open()
    assert fill(rig, 100) == 100 and fill(rig, 150) == 150
    rig.plug.unplug()
    assert wait_until(lambda: rig.reader.stats().state == "WAITING")
    rig.plug.plug_in()
    assert wait_until(lambda: rig.reader.stats().state == "OPEN")
    assert fill(rig, 3) == 150 and fill(rig, 5) == 152


def test_a_port_that_is_not_there_is_one_clear_line(tmp_path):
    link = SerialLink("encoders", str(tmp_path / "none"), 115200, Ticking())
    with pytest.raises(
        DeviceError, match=r"^encoders: cannot open .*none: No such file or directory$"
    ):
        link.open()


def test_a_port_that_is_taken_is_refused(tmp_path):
    plug = Plug(tmp_path / "tty")
    first, second = (SerialLink("encoders", str(plug.path), 115200, Ticking()) for _ in range(2))
    first.open()
    with pytest.raises(DeviceError, match=r"^encoders: cannot open"):
        second.open()
    first.close()
    second.open()
    second.close()
    plug.close()


def test_an_ordinary_file_is_no_port(tmp_path):
    path = tmp_path / "file"
    path.write_text("hello")
    with pytest.raises(DeviceError, match="cannot open"):
        SerialLink("encoders", str(path), 115200, Ticking()).open()


@pytest.mark.parametrize("plugged", [True, False])
def test_stop_ends_the_thread_in_a_fifth_of_a_second(tmp_path, plugged):
    rig = Rig(tmp_path / "tty")
    if not plugged:
        rig.plug.unplug()
    rig.reader.start()
    assert wait_until(lambda: rig.reader.stats().state == "OPEN" or not plugged)
    assert rig.reader.stop(5.0)
    assert not any(thread.name == "reader encoders" for thread in threading.enumerate())
    assert rig.reader.stats().state == "ENDED"
    rig.close()


# ---- the reader without hardware -----------------------------------------------------------------


class FlakyLink:
    """Opens, then fails; or fails to open."""

    def __init__(self, opens: bool) -> None:
        self.damaged = 0
        self.opens = opens
        self.opened = self.closed = 0

    def open(self):
        if not self.opens:
            raise DeviceError("dev", "no such device")
        self.opened += 1

    def read(self):
        raise DeviceError("dev", "gone")

    def close(self):
        self.closed += 1


class Waits:
    """Stands in for the stop event: notes the waits and ends after some."""

    def __init__(self, count):
        self.waits, self.count = [], count

    def is_set(self):
        return len(self.waits) >= self.count

    def wait(self, seconds):
        self.waits.append(seconds)

    def clear(self):
        pass

    set = clear


def idle_decoder():
    device = serial_device()
    (reader,) = build_readers(wiring([device], CHANNELS), Ticking(), ReadingQueue())
    return reader.decoder


@pytest.mark.parametrize("opens", [True, False])
def test_back_off_doubles_to_its_cap_while_nothing_comes(opens):
    link = FlakyLink(opens)
    reader = Reader("dev", link, idle_decoder(), ReadingQueue())
    reader._stop = Waits(9)
    reader._run()
    assert reader._stop.waits == [0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0, 5.0]
    assert (reader._stop.waits[0], reader._stop.waits[-1]) == (BACKOFF_FIRST, BACKOFF_LAST)
    assert link.closed >= link.opened
    assert reader.stats().last_error.startswith("dev: ")


class BrokenLink(FlakyLink):
    def read(self):
        raise RuntimeError("a fault of ours")


def test_a_thread_that_dies_says_so_and_can_be_started_again():
    link = BrokenLink(True)
    reader = Reader("dev", link, idle_decoder(), ReadingQueue())
    reader.start()
    assert wait_until(lambda: not reader.alive)
    assert reader.stats().state == "DEAD"
    assert reader.stats().last_error == "dev: RuntimeError: a fault of ours"
    assert link.closed == link.opened == 1
    reader.start()
    assert wait_until(lambda: not reader.alive) and link.opened == 2


class NoiseLink(FlakyLink):
    """Random bytes, then silence."""

    def __init__(self, chunks):
        super().__init__(True)
        self.chunks = iter(chunks)

    def read(self):
        data = next(self.chunks, None)
        return data and Chunk(1, data)


@pytest.mark.parametrize("framing", ["cobs", "ascii"])
def test_the_thread_survives_any_byte_stream(framing):
    rng = random.Random(5)
    (built,) = build_readers(
        wiring([serial_device(framing=framing)], CHANNELS), Ticking(), ReadingQueue()
    )
    alphabet = b"$*,\r\n\0\x01k0123456789.eE+-nai"
    chunks = [
        rng.randbytes(64) if n % 2 else bytes(rng.choices(alphabet, k=64)) for n in range(20_000)
    ]
    reader = Reader("dev", NoiseLink(chunks), built.decoder, ReadingQueue())
    reader.start()
    assert wait_until(lambda: reader.stats().bytes == 64 * 20_000)
    assert reader.stop(2.0)
    stats = reader.stats()
    assert stats.state == "ENDED"
    assert stats.last_error == "" and stats.bad > 1000


def test_a_port_that_was_not_opened_is_an_error_of_the_device(tmp_path):
    link = SerialLink("encoders", str(tmp_path / "port"), 9600, Ticking())
    with pytest.raises(DeviceError, match="port is not open"):
        link.read()


def test_a_reader_that_runs_is_not_started_twice(tmp_path):
    rig = Rig(tmp_path / "port")
    rig.open()
    threads = threading.active_count()
    rig.reader.start()
    assert threading.active_count() == threads and rig.reader.stats().state == "OPEN"
    assert rig.reader.stop(60.0)
