"""What a damaged, cut, hostile or foreign recording gives back: never a wrong message, never a long
wait.
"""

from __future__ import annotations

import os
import random
import struct
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType

from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.blocks import records
from gritd.estimator.recording.mcapfile import MAGIC, RecordingError
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.topics import RAW_TOPICS
from tests.estimator.recording.hostile import HOSTILE, probe, record, text
from tests.estimator.recording.samples import FOREIGN, T0, write_foreign, write_sample

ENCODER = RAW_TOPICS[0]


def is_subsequence(part: list, whole: list) -> bool:
    rest = iter(whole)
    return all(any(item == other for other in rest) for item in part)


# ---- cut and flipped -----------------------------------------------------------------------------


@pytest.mark.parametrize("compression", ["zstd", pytest.param("none", marks=pytest.mark.long)])
@pytest.mark.long
def test_a_file_cut_at_any_byte_gives_a_prefix(tmp_path: Path, compression: str) -> None:
    """A power cut. At every offset: the whole chunks before it, and a line about the rest unless
    only index is cut.
    """
    writer = RunWriter(tmp_path / "a.mcap", [], "a: 1\n", RunInfo(), compression=compression)
    for i in range(9):
        writer.reading(Reading(T0 + i, "wheel_encoder", i, T0 + i))
        writer.reading(Reading(T0 + i, "sinkage_pot", i / 3, T0 + i))
        if i % 3 == 2:
            writer.flush()
    ends = [(tmp_path / "a.mcap").stat().st_size]
    writer.close()
    written = list(read(tmp_path / "a.mcap").messages())
    data = (tmp_path / "a.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    counts = []
    for size in range(len(data)):
        cut.write_bytes(data[:size])
        try:
            recording = read(cut)
        except RecordingError as error:
            assert "not an MCAP file" in str(error) and size < 40
            continue
        found = list(recording.messages())
        counts.append(len(found))
        assert found == written[: len(found)]
        assert not recording.complete
        assert size < ends[0] or (found == written and not recording.damage)
    assert sorted(set(counts)) == [0, 6, 12, 18] and counts == sorted(counts)  # chunk by chunk


def test_a_cut_inside_a_chunk_says_so(tmp_path: Path) -> None:
    write_sample(tmp_path / "a.mcap", 30, close=False, compression="none")
    os.truncate(tmp_path / "a.mcap", (tmp_path / "a.mcap").stat().st_size - 4000)
    assert len(read(tmp_path / "a.mcap").damage) == 1


@pytest.mark.parametrize("close", [True, False])
def test_flipped_bits_never_give_a_wrong_message(tmp_path: Path, close: bool) -> None:
    """In a chunk, its head, an index, the metadata or the summary: what comes is what was written,
    a loss is said.
    """
    written = write_sample(tmp_path / "a.mcap", 12, close=close, every=2)
    data = (tmp_path / "a.mcap").read_bytes()
    rng = random.Random(7)
    flipped = tmp_path / "b.mcap"
    for _ in range(400):
        broken = bytearray(data)
        for _ in range(rng.choice((1, 1, 1, 3))):
            broken[rng.randrange(8, len(data))] ^= 1 << rng.randrange(8)
        flipped.write_bytes(broken)
        recording = read(flipped)
        found = list(recording.messages())
        assert is_subsequence(found, written)
        assert found == written or recording.damage
        assert recording.config_yaml in (None, "wheel: {radius: 0.072}\n")
        assert recording.config_yaml or recording.damage


@pytest.mark.parametrize("seed", range(4))
def test_bursts_of_garbage_cost_only_the_chunks_they_hit(tmp_path: Path, seed: int) -> None:
    written = write_sample(tmp_path / "a.mcap", 200, close=bool(seed % 2), every=5)
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    rng = random.Random(seed)
    start = rng.randrange(len(data) // 3, len(data) // 2)
    data[start : start + 700] = rng.randbytes(700) if seed < 2 else bytes(700)
    (tmp_path / "b.mcap").write_bytes(data)
    recording = read(tmp_path / "b.mcap")
    found = list(recording.messages())
    assert is_subsequence(found, written) and recording.damage
    assert len(found) >= len(written) - 4 * 36  # at most four of forty chunks
    assert recording.lost == len(written) - len(
        found
    )  # by the statistics, or by the gap in the numbering


def test_damage_to_the_magic_does_not_cost_the_recording(tmp_path: Path) -> None:
    written = write_sample(tmp_path / "a.mcap")
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    data[2] ^= 8
    (tmp_path / "a.mcap").write_bytes(data)
    recording = read(tmp_path / "a.mcap")
    assert list(recording.messages()) == written and len(recording.damage) == 1


def test_a_lying_message_index_changes_nothing(tmp_path: Path) -> None:
    """The index is under no checksum: the records themselves decide."""
    written = write_sample(tmp_path / "a.mcap", 20, close=False, every=4)
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    rng = random.Random(1)
    for opcode, start, end in list(records(bytes(data[8:]))):
        if opcode == Opcode.MESSAGE_INDEX:
            entries = np.frombuffer(bytes(data[8 + start + 6 : 8 + end]), "<u8").copy()
            lie = rng.choice(("first", "shift", "wild"))
            entries[1] = {"first": 1 << 63, "shift": entries[1] + 1, "wild": rng.randrange(2000)}[
                lie
            ]
            data[8 + start + 6 : 8 + end] = entries.tobytes()
    (tmp_path / "a.mcap").write_bytes(data)
    assert list(read(tmp_path / "a.mcap").messages()) == written


# ---- other writers -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "options",
    [
        {"compression": CompressionType.LZ4, "chunk_size": 3000},
        {"compression": CompressionType.NONE},
        {"compression": CompressionType.ZSTD, "enable_crcs": False, "chunk_size": 500},
        {"use_chunking": False},
        {
            "use_chunking": False,
            "repeat_channels": False,
            "repeat_schemas": False,
            "use_statistics": False,
        },
        {"index_types": IndexType.NONE, "use_summary_offsets": False},
    ],
    ids=["lz4", "plain", "no-crc", "unchunked", "no-summary", "no-index"],
)
def test_other_writers_are_read_by_their_own_schema(
    tmp_path: Path, options: dict[str, object]
) -> None:
    write_foreign(tmp_path / "a.mcap", **options)
    recording = read(tmp_path / "a.mcap")
    assert recording.damage == [] and recording.complete
    rows = recording.arrays("/raw/wheel_encoder")
    assert (
        rows.dtype.names == ("log_time", "order", "stamp", "count")
        and rows["count"].dtype == np.int64
    )
    assert rows["count"].tolist() == [-i for i in range(500)]
    assert rows["stamp"].tolist() == [T0 + i * 10**6 - 5 for i in range(500)]
    assert [values for topic, _, values in recording.messages() if topic == "/note"][1] == (
        "load 100",
    )
    assert recording.counts["/blob"] == 5 and "/blob" not in recording.topics
    assert recording.config_yaml is None and recording.run.nominal_load is None
    checked = options.get("use_chunking", True) and options.get("enable_crcs", True)
    assert recording.unverified == (0 if checked else 510)


def test_a_topic_that_the_caller_does_not_know_has_the_files_fields(tmp_path: Path) -> None:
    write_foreign(tmp_path / "a.mcap")
    rows = read(tmp_path / "a.mcap", topics=()).arrays("/raw/wheel_encoder")
    assert rows.dtype.names == ("log_time", "order", "count", "stamp", "quality", "voltage")
    assert rows[7].tolist() == (T0 + 7 * 10**6, 9, -7, T0 + 7 * 10**6 - 5, 3, 1.5)


@pytest.mark.parametrize(
    ("schema", "complaint"),
    [
        (FOREIGN.replace("count", "ticks"), "no field 'count'"),
        (
            FOREIGN.replace("int32 count", "float32 count"),
            "field 'count' is float32; expected int64",
        ),
        (FOREIGN.replace("uint8 quality", "string frame_id"), "flat ros2msg schema"),
        (FOREIGN.replace("uint8 quality", "float64[3] xyz"), "flat ros2msg schema"),
    ],
)
def test_a_raw_topic_without_the_expected_fields_is_one_clear_line(
    tmp_path: Path, schema: str, complaint: str
) -> None:
    write_foreign(tmp_path / "a.mcap", schema=schema)
    with pytest.raises(RecordingError) as caught:
        read(tmp_path / "a.mcap")
    assert complaint in str(caught.value) and "/raw/wheel_encoder" in str(caught.value)
    assert str(tmp_path / "a.mcap") in str(caught.value) and "\n" not in str(caught.value)


def test_messages_that_do_not_fit_their_schema_are_left_out_and_said(tmp_path: Path) -> None:
    write_foreign(tmp_path / "a.mcap", schema=FOREIGN + "float64 more\n")
    recording = read(tmp_path / "a.mcap")
    assert recording.arrays("/raw/wheel_encoder").size == 0 and recording.counts["/note"] == 5
    assert any(
        "500 messages skipped: they do not fit the fields of /raw/wheel_encoder" in d
        for d in recording.damage
    )


def test_a_contradicting_definition_is_not_followed(tmp_path: Path) -> None:
    """Two files glued together: the second part's channel 1 is another one."""
    write_foreign(tmp_path / "a.mcap", 20)
    write_sample(tmp_path / "b.mcap", 20, close=False)
    header = len(MAGIC)
    data = (tmp_path / "b.mcap").read_bytes() + (tmp_path / "a.mcap").read_bytes()[header:]
    (tmp_path / "c.mcap").write_bytes(data)
    recording = read(tmp_path / "c.mcap")
    assert any("defined twice, differently" in line for line in recording.damage)
    assert list(recording.messages()) == list(read(tmp_path / "b.mcap").messages())


def definition(number: int, name: str, fields: str = "int32 data") -> bytes:
    """A schema's record."""
    body = struct.pack("<H", number) + text(name) + text("ros2msg") + text(fields)
    return record(Opcode.SCHEMA, body)


def channel(number: int, schema: int, topic: str) -> bytes:
    body = struct.pack("<HH", number, schema) + text(topic) + text("cdr") + struct.pack("<I", 0)
    return record(Opcode.CHANNEL, body)


MANY = b"".join(definition(n, f"m/msg/M{n}", "int32 data\n" * 80_000) for n in range(100, 122))


@pytest.mark.parametrize(
    "records, words",
    [
        (definition(99, "a/msg/A") + definition(99, "b/msg/B"), "schema 99 is defined twice"),
        (channel(99, 98, "/a"), "channel 99 refers to schema 98, which is missing"),
        (
            definition(99, "a/msg/A") + channel(99, 99, "/a") + channel(99, 99, "/b"),
            "channel 99 is",
        ),
        (MANY, "bytes of definitions"),
        (record(Opcode.MESSAGE_INDEX, struct.pack("<HI", 1, 99)), "of a message index contradict"),
        (record(Opcode.METADATA, text("a") + bytes(17 << 20)), "bytes of metadata"),
        (record(Opcode.HEADER, text("a") * (1 << 20)), "a header of"),
    ],
)
def test_what_contradicts_itself_is_said_and_costs_no_more(
    tmp_path: Path, records: bytes, words: str
) -> None:
    """Before and after it stand whole recordings' chunks."""
    write_sample(tmp_path / "b.mcap", 20, close=False)
    whole = (tmp_path / "b.mcap").read_bytes()
    (tmp_path / "c.mcap").write_bytes(whole + records)
    recording = read(tmp_path / "c.mcap")
    assert any(words in line for line in recording.damage), recording.damage
    assert list(recording.messages()) == list(read(tmp_path / "b.mcap").messages())


# ---- hostile -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(HOSTILE))
@pytest.mark.long
def test_a_hostile_file_costs_bounded_memory_and_time(tmp_path: Path, name: str) -> None:
    (tmp_path / "a.mcap").write_bytes(HOSTILE[name]())
    seconds, memory, said = probe(tmp_path / "a.mcap")
    print(f"{name}: {seconds} s, {memory} MB: {said}")
    assert memory <= 256
    assert said.startswith(("RecordingError", "0 messages"))
    assert seconds <= 20  # measured: at most 1.2 s on an idle machine


def test_a_sparse_file_of_10_gb_costs_bounded_memory_and_time(tmp_path: Path) -> None:
    written = write_sample(tmp_path / "a.mcap", 10, close=False)
    os.truncate(tmp_path / "a.mcap", 10 << 30)
    seconds, memory, said = probe(tmp_path / "a.mcap")
    print(f"sparse 10 GB: {seconds} s, {memory} MB: {said}")
    assert memory <= 256 and seconds <= 20
    assert said.startswith(f"{len(written)} messages") and "skipped" in said


def test_a_missing_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot read: No such file or directory"):
        read(tmp_path / "none.mcap")


def test_a_long_recording_is_read_without_holding_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beyond the memory kept, chunks are unpacked again: same messages."""
    written = write_sample(tmp_path / "a.mcap", 60)
    monkeypatch.setattr("gritd.estimator.recording.salvage.MAX_KEPT", 9_000)
    recording = read(tmp_path / "a.mcap")
    assert list(recording.messages()) == written
    assert list(recording.messages()) == written
