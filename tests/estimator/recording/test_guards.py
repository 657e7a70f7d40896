"""What a reader or writer refuses before it does harm, one guard at a time."""

from __future__ import annotations

import errno
import os
import struct
from pathlib import Path

import pytest

from gritd.estimator.limits import VARIABLE
from gritd.estimator.messages.readings import Reading
from gritd.estimator.recording import mcapfile
from gritd.estimator.recording.backlog import Backlog, PartStart
from gritd.estimator.recording.blocks import Damaged, records
from gritd.estimator.recording.cdr import Codec
from gritd.estimator.recording.mcapfile import MAGIC, McapFile, RecordingError
from gritd.estimator.recording.retention import sweep
from gritd.estimator.recording.salvage import read
from tests.estimator.recording.hostile import HEADER, chunk, record
from tests.estimator.recording.samples import FOREIGN, T0, write_foreign, write_sample

INDEX = struct.pack("<HI", 0, 0)  # a message index without entries


def damage_of(folder: Path, content: bytes) -> str:
    path = folder / "a.mcap"
    path.write_bytes(content)
    recording = read(path)
    assert not list(recording.messages()) and not recording.complete
    return "; ".join(recording.damage)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (chunk(b"x" * 100, 100, "", stored=99), "the lengths of a chunk contradict each other"),
        (record(7, INDEX + b"more"), "the lengths of a message index contradict each other"),
        (record(1, bytes(2_000_000)), "a header of 2000000 bytes"),
        (record(77, b"x"), "no record of MCAP's data section has opcode 0x4d"),
    ],
)
def test_a_record_that_contradicts_itself_is_said(
    tmp_path: Path, content: bytes, words: str
) -> None:
    assert words in damage_of(tmp_path, HEADER + content)


def test_an_index_before_any_chunk_does_no_harm(tmp_path: Path) -> None:
    assert "index" not in damage_of(tmp_path, HEADER + record(7, INDEX))


@pytest.mark.parametrize(
    ("limit", "words"),
    [("chunk=200 B", "chunks up to 200 are read"), ("chunks=2", "more than 2 chunks")],
)
def test_a_limit_is_said_and_what_is_read_is_a_prefix(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, words: str
) -> None:
    written = write_sample(tmp_path / "a.mcap")
    monkeypatch.setenv(VARIABLE, limit)
    recording = read(tmp_path / "a.mcap")
    found = list(recording.messages())
    assert len(found) < len(written) and found == written[: len(found)]
    assert any(words in line for line in recording.damage)


@pytest.mark.parametrize("length", [90_000, 6_000_000])
def test_a_bare_record_of_any_size_is_read_or_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, length: int
) -> None:
    """Without chunks; one is larger than what is looked at at once."""
    monkeypatch.setenv(VARIABLE, "chunk=1 MB")
    said = damage_of(tmp_path, HEADER + record(5, bytes(length)))
    assert ("an unchunked record larger than 1000000 bytes" in said) == (length > 1_000_000)


@pytest.mark.parametrize("data", [b"\x05\x01", record(5, b"abc")[:-1]])
def test_records_that_do_not_fill_their_block_are_damage(data: bytes) -> None:
    with pytest.raises(Damaged, match="ends inside a record"):
        list(records(data))


# --- messages ---


def test_bytes_that_are_no_message_of_the_type_are_refused() -> None:
    codec = Codec((("text", "string", ""),))
    whole = codec.encode(("sand",))
    assert codec.decode(whole) == ("sand",)
    with pytest.raises(ValueError, match="not little-endian CDR"):
        codec.decode(b"\x00\x00" + whole[2:])  # the other order of bytes
    with pytest.raises(ValueError, match=r"runs past the end|not a message"):
        codec.decode(whole[:4] + struct.pack("<I", 200) + whole[8:])
    with pytest.raises(ValueError, match="field 'x': type 'int65' is not one of"):
        Codec((("x", "int65", ""),))


def test_a_field_of_another_kind_is_named(tmp_path: Path) -> None:
    write_foreign(tmp_path / "a.mcap", 3, FOREIGN.replace("int32 count", "string count"))
    with pytest.raises(RecordingError, match="not CDR with a flat ros2msg schema"):
        read(tmp_path / "a.mcap")
    write_foreign(tmp_path / "b.mcap", 3, FOREIGN.replace("int32 count", "float32 count"))
    with pytest.raises(RecordingError, match="field 'count' is float32; expected int64"):
        read(tmp_path / "b.mcap")


# --- files ---


def test_a_pipe_is_no_recording_and_nobody_waits(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.mcap")
    with pytest.raises(RecordingError, match="no regular file"):
        read(tmp_path / "a.mcap")


def test_an_unknown_compression_is_refused_before_a_file_is_made(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="compression 'brotli' is not one of"):
        McapFile(tmp_path / "a.mcap", "brotli")
    assert not list(tmp_path.iterdir())


def test_a_draft_that_was_left_is_replaced_and_a_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / f".a.mcap{mcapfile.DRAFT}").write_bytes(b"begun and left")
    precious = tmp_path / "precious"
    precious.write_bytes(b"kept")
    write_sample(tmp_path / "a.mcap", 3)
    assert read(tmp_path / "a.mcap").complete

    (tmp_path / f".b.mcap{mcapfile.DRAFT}").symlink_to(precious)
    with pytest.raises(RecordingError, match="is no regular file"):
        write_sample(tmp_path / "b.mcap", 3)
    assert precious.read_bytes() == b"kept"


def test_a_draft_whose_name_is_taken_is_left_alone(tmp_path: Path) -> None:
    """A power cut took its name back, and somebody has put another recording there."""
    write_sample(tmp_path / "a.mcap", 5)
    lost, there = tmp_path / f".a.mcap{mcapfile.DRAFT}", (tmp_path / "a.mcap").read_bytes()
    lost.write_bytes(there)
    assert sweep(tmp_path) == []
    assert lost.exists() and (tmp_path / "a.mcap").read_bytes() == there
    (tmp_path / "a.mcap").unlink()
    assert sweep(tmp_path) == [tmp_path / "a.mcap"] and not lost.exists()


@pytest.mark.parametrize("number", [errno.EINVAL, errno.ENOSYS, errno.EIO])
def test_only_a_file_system_that_knows_no_sync_may_refuse_it(
    monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def refused(fileno: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(mcapfile.os, "fdatasync", refused)
    if number == errno.EIO:
        with pytest.raises(OSError, match="Input/output error"):
            mcapfile.sync(0)
    else:
        mcapfile.sync(0)


def test_magic_alone_is_said(tmp_path: Path) -> None:
    assert damage_of(tmp_path, MAGIC)


# --- the queue before the disk ---


class Short(list):
    """Memory ends after two of its items."""

    def __iter__(self):
        yield from list.__getitem__(self, slice(0, 2))
        raise MemoryError


def reading(i: int) -> Reading:
    return Reading(T0 + i, "wheel_encoder", i, T0 + i)


def test_messages_for_which_memory_is_short_are_not_counted_nor_kept() -> None:
    backlog = Backlog(10)
    backlog.put([reading(0)])
    with pytest.raises(MemoryError):
        backlog.put(Short([reading(1), reading(2), reading(3)]))
    assert backlog.counters() == (1, 0, 0, 1)
    assert backlog.take() == ([reading(0)], 0, "")


def test_a_part_that_is_dropped_leaves_its_configuration() -> None:
    backlog = Backlog(2)
    backlog.put([PartStart("wheel: {}\n", ("/log", T0, ()))])
    backlog.put([reading(1), reading(2)])
    assert backlog.take() == ([reading(1), reading(2)], 1, "wheel: {}\n")
