"""Recorded input goes the way of a live device, and comes out the same."""

from __future__ import annotations

import random
import time

import pytest

from gritd.drivers.build import build_decoder, build_readers
from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.link import Chunk
from gritd.drivers.queue import ReadingQueue
from gritd.drivers.reader import Reader
from gritd.drivers.recorded import RecordedLink, decoded, paced, play
from gritd.drivers.wire import CanWire, SerialWire
from gritd.drivers.wire_log import MAGIC, WireWriter, read_wire
from gritd.estimator.messages.readings import Reading
from tests.drivers.rig import Plug, Ticking, can_device, channel, serial_device, wait_until, wiring
from tests.drivers.test_framing_can import chunk as can_chunk

SERIAL = [
    channel("wheel_encoder", "encoders", bits=16),
    channel("sinkage_pot", "encoders", low=0.0, high=5.0),
]


def decoder(framing="cobs"):
    device = serial_device(framing=framing)
    return build_decoder(wiring([device], SERIAL), device)


def drive(framing, seconds=3.0, seed=7):
    """A wheel that turns forward through the rollover of sixteen bits and back, chunks cut and
    delayed at random.
    """
    rng = random.Random(seed)
    wire = SerialWire(serial_device(framing=framing))
    chunks, waiting, truth = [], b"", []
    for n in range(int(seconds * 250)):
        count = 60_000 + 40 * min(n, 500) - 90 * max(n - 500, 0)
        truth.append(count)
        waiting += wire.encode("wheel_encoder", [count % 65536], 4000 * n)
        waiting += wire.encode("sinkage_pot", [1.0 + 0.001 * n], 4000 * n)
        if rng.random() < 0.4:
            cut = rng.randrange(len(waiting) + 1)
            chunks.append(Chunk(10**18 + n * 4_000_000 + rng.randrange(3_000_000), waiting[:cut]))
            waiting = waiting[cut:]
    chunks.append(Chunk(10**18 + n * 4_000_000 + 3_000_000, waiting))
    return chunks, truth


@pytest.fixture(params=["cobs", "ascii"])
def log(request, tmp_path):
    """(framing, path of a wire log, its chunks, true counts)"""
    chunks, truth = drive(request.param)
    writer = WireWriter(tmp_path / "run.wire")
    for chunk in chunks:
        writer(*chunk)
    writer.close()
    return request.param, tmp_path / "run.wire", chunks, truth


def test_a_wire_log_gives_back_its_chunks(log):
    _, path, chunks, _ = log
    assert list(read_wire(path)) == chunks


def test_a_recorded_drive_through_the_real_framing(log):
    framing, path, _, truth = log
    readings = list(decoded(read_wire(path), decoder(framing)))
    wheel = [r for r in readings if r.channel == "wheel_encoder"]
    assert [r.value for r in wheel] == truth
    assert all(r.stamp <= r.received for r in readings)
    assert [r.stamp for r in wheel] == sorted({r.stamp for r in wheel})


def test_a_recorded_drive_through_a_real_reader_is_the_same(log):
    framing, path, chunks, _ = log
    queue = ReadingQueue(1 << 20)
    reader = Reader("encoders", RecordedLink(read_wire(path)), decoder(framing), queue)
    reader.start()
    assert wait_until(lambda: not reader.alive)
    assert queue.drain() == list(decoded(chunks, decoder(framing)))
    assert reader.stats().state == "ENDED" and reader.stats().last_error == ""


def test_a_live_run_and_its_wire_log_give_the_same_readings(tmp_path):
    plug = Plug(tmp_path / "tty")
    device = serial_device(plug.path)
    settings, queue = wiring([device], SERIAL), ReadingQueue(1 << 20)
    writer = WireWriter(tmp_path / "live.wire")
    (reader,) = build_readers(settings, Ticking(), queue, lambda name: writer)
    reader.start()
    assert wait_until(lambda: reader.stats().state == "OPEN")
    rng, wire = random.Random(8), SerialWire(device)
    for n in range(500):
        data = wire.encode("wheel_encoder", [n], 4000 * n)
        plug.deliver(
            data if rng.random() > 0.1 else data[: rng.randrange(len(data))] + rng.randbytes(3)
        )
    plug.deliver(b"\0" + wire.encode("sinkage_pot", [4.5], 2_000_000))
    live = []
    assert wait_until(lambda: live.extend(queue.drain()) or any(r.value == 4.5 for r in live))
    assert reader.stop(2.0)
    writer.close()
    plug.close()
    assert list(decoded(read_wire(tmp_path / "live.wire"), build_decoder(settings, device))) == live
    assert 300 < len(live) < 501  # a tenth were damaged, each at the cost of two at most


def test_a_recorded_can_bus(tmp_path):
    device = can_device()
    wire = CanWire(device)
    settings = wiring([device], [channel("wheel_encoder", "bus", "WheelEncoder.Count")])
    writer = WireWriter(tmp_path / "can.wire")
    for n in range(100):
        writer(10**18 + n * 4_000_000, can_chunk(wire.encode("WheelEncoder.Count", [n], 4000 * n)))
    writer.close()
    readings = list(decoded(read_wire(tmp_path / "can.wire"), build_decoder(settings, device)))
    assert [r.value for r in readings] == list(range(100))


def test_a_log_cut_anywhere_gives_what_is_before_the_cut(tmp_path):
    chunks, _ = drive("cobs", seconds=0.04)
    path = tmp_path / "run.wire"
    writer = WireWriter(path)
    for chunk in chunks:
        writer(*chunk)
    writer.close()
    data = path.read_bytes()
    for size in range(len(MAGIC), len(data)):
        path.write_bytes(data[:size])
        got = list(read_wire(path))
        assert got == chunks[: len(got)]


@pytest.mark.parametrize(
    "content, expected",
    [(b"", "not a wire log"), (b"\x89MCAP0", "not a wire log"), (None, "No such file")],
)
def test_what_is_no_wire_log_is_one_clear_line(tmp_path, content, expected):
    path = tmp_path / "x.wire"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(DeviceSettingsError, match=expected):
        list(read_wire(path))


def test_a_length_that_cannot_be_ends_the_log(tmp_path):
    path = tmp_path / "x.wire"
    path.write_bytes(MAGIC + b"\xff" * 4000)
    assert list(read_wire(path)) == []


def test_readings_are_played_into_the_queue_in_order():
    readings = [Reading(n, "sinkage_pot", 1.0, n) for n in range(50)]
    queue = ReadingQueue()
    play(readings, queue)
    assert queue.drain() == readings


def test_paced_playing_waits_for_what_is_not_due():
    waits = []
    items = [
        Reading(0, "sinkage_pot", 1.0, received) for received in (10**18, 10**18, 10**18 + 10**12)
    ]
    assert list(paced(items, waits.append)) == items
    assert len(waits) == 1 and 900.0 < waits[0] <= 1000.0


def test_a_reader_in_real_time_takes_the_recorded_time_and_can_be_stopped():
    chunks, _ = drive("cobs", seconds=0.4)
    queue = ReadingQueue()
    start = time.monotonic()
    reader = Reader("encoders", RecordedLink(chunks, real_time=True), decoder(), queue)
    reader.start()
    assert wait_until(lambda: not reader.alive)
    assert time.monotonic() - start >= (chunks[-1].received - chunks[0].received) * 1e-9
    assert queue.counts().received == 200
    endless = Reader(
        "encoders",
        RecordedLink([chunks[0], chunks[0]._replace(received=1 << 62)], True),
        decoder(),
        queue,
    )
    endless.start()
    assert wait_until(lambda: endless.stats().bytes > 0) and endless.stop(2.0)
