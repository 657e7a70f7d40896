"""Chunks checked a pile at a time: what is read, and what is said, is what chunk by chunk gives."""

from __future__ import annotations

import random
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from mcap.records import Channel, Schema

from gritd.estimator.compiled import records
from gritd.estimator.limits import limits
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording import piles, salvage
from gritd.estimator.recording.cdr import Topic
from gritd.estimator.recording.mcapfile import McapFile, RecordingError
from gritd.estimator.recording.message_records import MESSAGE_HEAD, RECORD_HEAD
from gritd.estimator.recording.recording import Recording
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.topics import RAW_TOPICS, TICK_TOPIC
from tests.estimator.recording.samples import MIXED, T0, reading_of, write_foreign, write_sample

WANTED = {topic.name: None for topic in RAW_TOPICS} | {"/mixed": None}


def everything(path: Path) -> object:
    """All that a reader says and gives."""
    recording = read(path, tables=WANTED)
    said = {
        name: value
        for name, value in vars(recording).items()
        if name not in ("sources", "_piles", "_kept", "_tables")
    }
    tables = {
        name: (rows.dtype.names, rows.tolist())
        for name, rows in recording.tables(known(recording)).items()
    }
    chunks = [chunk.records()[0] for chunk in recording.chunks()]
    return repr((said, list(recording.messages()), tables)), b"".join(chunks)


def known(recording: Recording) -> dict[str, None]:
    return {topic: None for topic in WANTED if topic in recording.topics}


def damaged(data: bytes, rng: random.Random) -> bytes:
    """A file with something wrong with it: bits, a cut, a part missing, twice or elsewhere."""
    kind, at = rng.randrange(5), rng.randrange(8, len(data))
    length = rng.randrange(1, 3000)
    if kind == 0:
        flipped = bytearray(data)
        for _ in range(rng.randrange(1, 4)):
            flipped[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        return bytes(flipped)
    if kind == 1:
        return data[:at]
    if kind == 2:
        return data[:at] + data[at + length :]
    if kind == 3:
        return data[: at + length] + data[at:]
    return data[:at] + bytes(length) + data[at + length :]


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
@pytest.mark.parametrize("seed", range(12))
def test_damage_is_found_and_said_as_chunk_by_chunk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int, compression: str
) -> None:
    rng, path = random.Random(seed), tmp_path / "a.mcap"
    write_sample(path, 60, close=seed % 3 > 0, compression=compression, every=4)
    whole, found = path.read_bytes(), []

    for number in range(6):
        path.write_bytes(damaged(whole, rng) if number else whole)
        together = everything(path)
        with monkeypatch.context() as patched:
            patched.setattr(salvage, "opened", lambda *_: None)
            assert everything(path) == together
        found.append(together)
    assert len({repr(each) for each in found}) > 3


def test_an_intact_recording_is_read_in_piles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    singly = []
    one = salvage.RecordingCheck._block
    monkeypatch.setattr(
        salvage.RecordingCheck, "_block", lambda *given: singly.append(1) or one(*given)
    )
    write_sample(tmp_path / "a.mcap", 200, every=4)
    assert read(tmp_path / "a.mcap").complete
    assert not singly, "the index defines every channel"

    write_sample(tmp_path / "b.mcap", 200, every=4, close=False)
    assert not read(tmp_path / "b.mcap").complete
    assert len(singly) == 1, "without an index the first chunk alone tells what is new"


def test_other_writers_files_are_read_in_piles_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_foreign(tmp_path / "a.mcap", 3000, chunk_size=4000)
    together = everything(tmp_path / "a.mcap")
    monkeypatch.setattr(salvage, "opened", lambda *_: None)
    assert everything(tmp_path / "a.mcap") == together


def test_tables_of_some_fields_and_in_the_pass_of_reading_are_the_arrays(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_sample(path, 50)
    some = {"/mixed": ("e", "stamp"), "/raw/wrench": None, "/raw/motor_shunt": ("volts",)}
    early, late = read(path, tables=some).tables(some), read(path).tables(some)
    whole = read(path)

    for topic, fields in some.items():
        rows = whole.arrays(topic)
        names = ["log_time", "order", *(fields or rows.dtype.names[2:])]
        assert early[topic].dtype.names == late[topic].dtype.names == tuple(names)
        for name in names:
            assert np.array_equal(early[topic][name], rows[name])
            assert np.array_equal(late[topic][name], rows[name])
    assert not early["/mixed"].flags.writeable and late["/mixed"].flags.writeable


def write_two_channels(path: Path) -> None:
    """One topic by two channels in turn, as after a restart; one has a field more."""
    wide = Topic("/mixed", MIXED.schema_name, MIXED.fields[:3])
    narrow = Topic("/mixed", "gritd_msgs/msg/Narrow", MIXED.fields[:2])
    file, records, starts = McapFile(path, library="another"), bytearray(), []
    for number, topic in enumerate((wide, narrow), start=1):
        schema = Schema(
            id=number, name=topic.schema_name, encoding="ros2msg", data=topic.schema.encode()
        )
        file.define(schema, Channel(number, "/mixed", "cdr", {}, number))
    with file.beginning():
        pass
    for i in range(200):
        topic, channel = (wide, 1) if i % 3 else (narrow, 2)
        body = topic.codec.encode((T0 + i, i, 0.5 * i)[: len(topic.names)])
        starts.append(len(records))
        records += MESSAGE_HEAD.pack(5, 22 + len(body), channel, 0, T0 + i, T0 + i) + body
    file.add_chunk(records, np.array(starts))
    file.close()


def test_two_channels_of_one_topic_are_one_table_in_file_order(tmp_path: Path) -> None:
    write_two_channels(tmp_path / "a.mcap")
    wanted = {"/mixed": ("stamp", "a")}
    for recording in (read(tmp_path / "a.mcap", tables=wanted), read(tmp_path / "a.mcap")):
        rows = recording.tables(wanted)["/mixed"]
        assert rows["order"].tolist() == list(range(200))
        assert rows["a"].tolist() == list(range(200))
        assert rows["stamp"].tolist() == [T0 + i for i in range(200)]


def test_a_channel_without_a_field_of_its_topic_is_one_line(tmp_path: Path) -> None:
    """No value stands in for what is not there."""
    write_two_channels(tmp_path / "a.mcap")
    for wanted, words in (
        ({"/mixed": ("stamp", "b")}, "stamp, b"),
        ({"/mixed": None}, "the same fields"),
    ):
        recording = read(tmp_path / "a.mcap", tables=wanted)
        with pytest.raises(RecordingError, match=f"/mixed: not all of its messages have {words}"):
            recording.tables(wanted)


READ_SOME_THEN_ALL = r"""
import re, sys
from gritd.estimator.recording import salvage

def peak(path):
    tables = salvage.read(path, tables=wanted).tables(wanted)
    size = sum(rows.nbytes for rows in tables.values())
    return size, 1024 * int(re.search(r"VmHWM:\s*(\d+)", open("/proc/self/status").read())[1])

salvage.ROOM, wanted = 1 << 16, {"/tick": None, "/raw/wrench": None}
(_, before), (size, after) = map(peak, sys.argv[1:])
print(size, after - before)
"""


@pytest.mark.parametrize("closed", [True, False])
def test_tables_take_little_more_memory_than_they_hold(tmp_path: Path, closed: bool) -> None:
    """What the process takes: numpy 2.5 tells tracemalloc of both sizes of an array that grows."""
    for name, count in (("some.mcap", 10), ("all.mcap", 30_000)):
        write_ticks(tmp_path / name, count, closed)
    paths = [str(tmp_path / name) for name in ("some.mcap", "all.mcap")]
    command = [sys.executable, "-c", READ_SOME_THEN_ALL, *paths]
    size, taken = map(int, subprocess.check_output(command, text=True).split())
    assert size > 15e6 and taken < 1.3 * size


def write_ticks(path: Path, count: int, closed: bool) -> None:
    tick = tuple(0 for _ in TICK_TOPIC.names)
    writer = RunWriter(path, [TICK_TOPIC], "", RunInfo(), chunk_size=1 << 15)
    for i in range(count):
        writer.message("/tick", T0 + i, tick)
        writer.reading(reading_of("wrench", i))
    writer.flush()
    if closed:
        writer.close()


def test_an_index_that_counts_too_many_costs_no_more_than_the_file_can_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setattr(
        salvage, "_channel_counts", lambda statistics: dict.fromkeys(range(9), 2**40)
    )
    room = salvage.Tables.add
    monkeypatch.setattr(
        salvage.Tables, "add",
        lambda self, *given: asked.append(dict(self.expected)) or room(self, *given),
    )  # fmt: skip
    path = tmp_path / "a.mcap"
    write_sample(path)
    recording = read(path, tables=WANTED)
    most = limits().start + limits().ratio * path.stat().st_size
    assert 0 < max(asked[0].values()) * MESSAGE_HEAD.size <= most
    assert len(recording.tables(WANTED)["/raw/wrench"]) == 40 and recording.lost


def test_a_pile_reaches_no_further_than_it_may(tmp_path: Path) -> None:
    write_sample(tmp_path / "a.mcap", 400, every=2)
    recording = read(tmp_path / "a.mcap")
    for blocks in recording._piles:
        assert len(blocks) == 1 or sum(block.size for block in blocks) <= piles.ROOM
    assert len(list(recording.chunks())) == 200


compiled = pytest.mark.skipif(not records.BUILT, reason="gritd was installed without a compiler")


@compiled
@pytest.mark.parametrize("seed", range(12))
def test_compiled_and_by_numpy_the_same_is_read_and_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    rng, path = random.Random(100 + seed), tmp_path / "a.mcap"
    write_sample(path, 60, close=seed % 3 > 0, every=4)
    whole = path.read_bytes()

    for number in range(6):
        path.write_bytes(damaged(whole, rng) if number else whole)
        found = everything(path)
        with monkeypatch.context() as patched:
            patched.setattr(records, "BUILT", False)
            assert everything(path) == found


@compiled
def test_compiled_and_by_numpy_other_writers_files_are_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_foreign(tmp_path / "a.mcap", 3000, chunk_size=4000)
    write_two_channels(tmp_path / "b.mcap")
    wanted = {"/mixed": ("stamp", "a")}

    def both() -> object:
        rows = read(tmp_path / "b.mcap", tables=wanted).tables(wanted)["/mixed"]
        return everything(tmp_path / "a.mcap"), rows.tolist()

    found = both()
    monkeypatch.setattr(records, "BUILT", False)
    assert both() == found


@compiled
def test_what_is_walked_is_held_against_its_bounds() -> None:
    """Random bytes, lengths and ends: nothing, or messages that lie inside."""
    rng, walked = random.Random(3), 0
    sizes = np.array([records.UNKNOWN, 20, records.NOT_FIXED], np.int64)
    for _ in range(20_000):
        content = b"".join(some_record(rng) for _ in range(rng.randrange(1, 5)))
        content = content[: rng.randrange(len(content) + 1)] if rng.random() < 0.2 else content
        end = len(content) + rng.choice((0, 0, 0, -1, 5))
        found = records.walk(content, np.array([end], np.int64), sizes)
        if found is None:
            continue
        walked += 1
        starts = np.frombuffer(found[0], np.int64)
        assert end <= len(content) and starts[0] >= 0 and starts[-1] + 33 <= len(content)
        assert sum(count for _, _, count in found[3].values()) == len(starts) == len(found[2]) // 8
        assert set(found[3]) <= {1, 2}
    assert 1000 < walked < 19_000


@compiled
def test_chunks_are_found_within_the_bytes_that_are_given() -> None:
    """Heads with lengths that contradict each other, cut anywhere."""
    rng, found = random.Random(5), 0
    for _ in range(6000):
        data = b"".join(some_chunk(rng) for _ in range(rng.randrange(1, 4)))
        data = memoryview(data)[: rng.randrange(len(data) + 1)]
        end = 1000
        for start, stored, size, _, after in records.chunks(data, 1000, 2, 2):
            assert start == end + 53 and start + stored <= after <= 1000 + len(data)
            assert data[start - 1000 : start + stored - 1000] == b"x" * stored and 0 <= size < 2**62
            end, found = after, found + 1
    assert 1000 < found < 5000


def some_chunk(rng: random.Random) -> bytes:
    """A chunk with message indexes, more often right than wrong."""

    def perhaps(number: int) -> int:
        return rng.choice((0, 1, 44, 2**62, 2**64 - 1)) if rng.random() < 0.04 else number

    stored, entries = rng.randrange(40), [16 * rng.randrange(3) for _ in range(rng.randrange(4))]
    head = RECORD_HEAD.pack(rng.choices((6, 7), (20, 1))[0], perhaps(44 + stored))
    head += struct.pack("<QQQI", 0, 0, perhaps(90), 7)
    head += rng.choices((b"\4\0\0\0zstd", b"\3\0\0\0lz4\0"), (20, 1))[0]
    indexes = (struct.pack("<BQHI", 7, perhaps(n + 6), 1, n) + bytes(n) for n in entries)
    return head + struct.pack("<Q", perhaps(stored)) + b"x" * stored + b"".join(indexes)


def some_record(rng: random.Random) -> bytes:
    """A message or a definition, more often right than wrong."""
    opcode = rng.choices((5, 3, 4, 9), (20, 1, 1, 1))[0]
    body = MESSAGE_HEAD.pack(opcode, 0, rng.choices((1, 2, 0, 7), (10, 4, 1, 1))[0], 0, 0, 0)[9:]
    body += b"\x00\x01\x00\x00" + bytes(rng.choice((16, 16, 16, 18, 24, 60)))
    length = rng.choices((len(body), rng.randrange(100), 1 << 63), (20, 1, 1))[0]
    return RECORD_HEAD.pack(opcode, length) + body


@compiled
def test_what_is_copied_lies_within_its_record_and_its_row() -> None:
    starts, own, rows = np.array([0]), np.array([0]), np.zeros(24, np.uint8)
    given = (bytes(40), starts, own, rows, 40, 0)
    records.fill(*given, ((32, 16, 8),), ())
    for pieces, times in [
        (((33, 16, 8),), ()),
        (((32, 17, 8),), ()),
        (((-1, 16, 8),), ()),
        (((0, 0, -1),), ()),
        ((), ((37, 16, 0),)),
        ((), ((0, 17, 4),)),
    ]:
        with pytest.raises(ValueError, match="outside"):
            records.fill(*given, pieces, times)
    for own in (np.array([1]), np.array([-1])):
        with pytest.raises(ValueError, match="outside its block"):
            records.fill(bytes(40), starts, own, rows, 40, 0, (), ())


def test_the_checksum_is_that_of_zlib() -> None:
    rng = random.Random(4)
    for size in (*range(200), 1000, 4097, 1 << 17):
        data = rng.randbytes(size)
        assert records.crc32(data) == zlib.crc32(data)
        assert records.crc32(memoryview(data)[1:]) == zlib.crc32(data[1:])
