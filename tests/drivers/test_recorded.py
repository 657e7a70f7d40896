"""Recorded input goes the way of a live device, and comes out the same."""

from __future__ import annotations

import os
import random
import time

import pytest

from gritd.drivers.build import build_decoder, build_readers
from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.link import Chunk
from gritd.drivers.queue import ReadingQueue
from gritd.drivers.reader import Reader
from gritd.drivers.recorded import Playback, decoded
from gritd.drivers.wire import CanWire, SerialWire
from gritd.drivers.wire_log import MAGIC, WireWriter, read_wire, wire_path
from tests.drivers.rig import Plug, Ticking, can_device, channel, serial_device, wait_until, wiring
from tests.drivers.rig import chunk as can_chunk

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
            cut = rng.randrange(1, len(waiting) + 1)
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


def test_a_recorded_drive_through_a_real_reader_is_the_same_but_for_the_time(log):
    """On the present clock every reading comes as long after the first chunk as it was recorded."""
    framing, path, chunks, _ = log
    queue, began = ReadingQueue(1 << 20), time.monotonic_ns()
    playback = Playback({"encoders": path}, lambda: time.monotonic_ns() + 5 * began)
    reader = Reader("encoders", playback.link("encoders"), decoder(framing), queue)
    reader.start()
    assert wait_until(lambda: playback.over)
    assert time.monotonic_ns() - began >= chunks[-1].received - chunks[0].received
    assert reader.stop(2.0)

    live, recorded = queue.drain(), list(decoded(chunks, decoder(framing)))
    shift = live[0].received - recorded[0].received
    assert shift >= 6 * began - chunks[0].received
    assert live == [
        r._replace(stamp=r.stamp + shift, received=r.received + shift) for r in recorded
    ]
    stats = reader.stats()
    assert stats.state == "ENDED" and stats.last_error == "" and stats.bad == 0


def test_devices_keep_their_distances(tmp_path):
    """The first chunk of all is due at once; that of the other device, later by what it was."""
    for name, received in (("a", 10**18 + 500), ("b", 10**18)):
        writer = WireWriter(wire_path(tmp_path, name))
        writer(received, b"x")
        writer.close()
    wires = {name: wire_path(tmp_path, name) for name in ("a", "b")}
    playback = Playback(wires, lambda: 7_000_000)
    links = {name: playback.link(name) for name in wires}
    for link in links.values():
        link.open()
    assert links["b"].read() == Chunk(7_000_000, b"x")
    assert links["a"].read() == Chunk(7_000_500, b"x")
    assert not playback.over
    assert links["a"].read() is links["b"].read() is None and playback.over


def test_a_reader_of_a_recorded_wire_can_be_stopped_while_it_waits(tmp_path):
    path = tmp_path / "encoders.wire"
    writer = WireWriter(path)
    for received in (0, 1 << 62):
        writer(received, b"k1,2\n")
    writer.close()
    playback = Playback({"encoders": path}, time.monotonic_ns)
    reader = Reader("encoders", playback.link("encoders"), decoder(), ReadingQueue())
    reader.start()
    assert wait_until(lambda: reader.stats().bytes > 0)
    assert reader.stop(2.0) and not playback.over


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


def test_a_device_that_was_opened_again_is_decoded_anew(tmp_path):
    """What stood unfinished when it was unplugged is no part of what came after."""
    wire = SerialWire(serial_device())
    whole = wire.encode("sinkage_pot", [2.0], 8000)
    chunks = [Chunk(0, b""), Chunk(1, whole[:5]), Chunk(2, b""), Chunk(3, whole)]
    log = WireWriter(tmp_path / "run.wire")
    for chunk in chunks:
        log(*chunk)
    log.close()
    assert list(read_wire(tmp_path / "run.wire")) == chunks

    again = decoder()
    assert [r.value for r in decoded(chunks, again)] == [2.0]
    assert again.framing.counts.bad == 0 and again.framing.counts.good == 1


def test_a_log_that_cannot_be_written_on_is_given_up_and_reported(tmp_path, monkeypatch):
    """A full disk must not end a reader."""
    path = tmp_path / "run.wire"
    writer = WireWriter(path)
    writer(1, b"kept")
    honest = writer._file
    writer._file = open("/dev/full", "wb", buffering=0)  # noqa: SIM115 - closed by the writer
    for received in (2, 3):
        writer(received, b"lost")
    writer.close()
    honest.close()
    assert "space" in writer.error and writer.bytes == 4
    assert list(read_wire(path)) == [Chunk(1, b"kept")]


def test_a_log_that_is_there_is_not_overwritten(tmp_path):
    path = tmp_path / "run.wire"
    WireWriter(path).close()
    with pytest.raises(DeviceSettingsError, match=r"run\.wire: File exists"):
        WireWriter(path)


def test_a_device_of_any_name_has_its_log_in_the_folder(tmp_path):
    for name in ("encoders", "a b", "../../up", ".", "Brücke/1"):
        path = wire_path(tmp_path, name)
        assert path.parent == tmp_path and path.name.endswith(".wire")
        WireWriter(path).close()
    assert len(list(tmp_path.iterdir())) == 5


def test_a_pipe_is_no_log(tmp_path):
    os.mkfifo(tmp_path / "x.wire")
    with pytest.raises(DeviceSettingsError, match="not a file, expected a wire log"):
        list(read_wire(tmp_path / "x.wire"))
