"""The recording contract: what we write is what other readers read, value for value."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.records import ChunkIndex

from gritd.estimator.messages.readings import CHANNELS
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.messages.tick import TICK_FIELDS
from gritd.estimator.recording.cdr import BILLION, CODES, STRING, TIME, Codec, Topic, parse_schema
from gritd.estimator.recording.chunk_index import ChunkIndexes
from gritd.estimator.recording.mcapfile import RecordingError, record_bytes
from gritd.estimator.recording.parts import part_path, parts
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.salvage import read
from gritd.estimator.recording.topics import LOG_TOPIC, RAW_TOPICS
from tests.estimator.recording.samples import MIXED, T0, mixed_values, reading_of, write_sample

TICK = Topic("/tick", "gritd_msgs/msg/Tick", TICK_FIELDS)

RANGES = {
    "bool": st.booleans(),
    TIME: st.integers(0, (2**31 - 1) * BILLION + BILLION - 1),
    STRING: st.text(max_size=9),
}
RANGES |= {kind: st.floats(width=int(kind[-2:])) for kind in ("float32", "float64")}  # type: ignore[arg-type]
for kind, code in CODES.items():
    if "int" in kind:
        bits, signed = 8 * struct.calcsize(code), code.islower()
        RANGES[kind] = st.integers(-(2 ** (bits - 1)) if signed else 0, 2 ** (bits - signed) - 1)


def same(a: object, b: object) -> bool:
    return a == b or (
        isinstance(a, float) and isinstance(b, float) and math.isnan(a) and math.isnan(b)
    )


@st.composite
def fields_and_values(draw: st.DrawFn) -> tuple[tuple[tuple[str, str, str], ...], list[object]]:
    kinds = draw(st.lists(st.sampled_from(sorted(RANGES)), min_size=1, max_size=12))
    fields = tuple((f"f{i}", kind, "") for i, kind in enumerate(kinds))
    return fields, [draw(RANGES[kind]) for kind in kinds]


@given(fields_and_values())
@settings(max_examples=300)
def test_every_message_decodes_to_what_was_encoded(
    drawn: tuple[tuple[tuple[str, str, str], ...], list[object]],
) -> None:
    fields, values = drawn
    codec = Codec(fields)
    decoded = codec.decode(codec.encode(values))
    assert len(decoded) == len(values) and all(map(same, decoded, values))


@given(fields_and_values())
@settings(max_examples=150)
def test_the_ros_library_decodes_our_bytes_by_our_schema(
    drawn: tuple[tuple[tuple[str, str, str], ...], list[object]],
) -> None:
    dynamic = pytest.importorskip("mcap_ros2._dynamic", reason="mcap-ros2-support is not installed")
    fields, values = drawn
    topic = Topic("/t", "pkg/msg/Any", fields)
    message = dynamic.generate_dynamic(topic.schema_name, topic.schema)[topic.schema_name](
        topic.codec.encode(values)
    )
    for (name, kind, _), value in zip(fields, values, strict=True):
        found = getattr(message, name)
        assert same(found.sec * BILLION + found.nanosec if kind == TIME else found, value)


def test_alignment_counts_from_the_byte_after_the_encapsulation_header() -> None:
    codec = Codec((("a", "uint8", ""), ("b", "float64", ""), ("c", "uint16", "")))
    assert codec.encode((7, 1.5, 9)) == bytes([0, 1, 0, 0, 7]) + bytes(7) + struct.pack(
        "<dH", 1.5, 9
    )
    assert codec.size == 4 + 18  # nothing is padded at the end


@pytest.mark.parametrize(
    "topic", [*RAW_TOPICS, LOG_TOPIC, MIXED, TICK], ids=lambda topic: topic.name
)
def test_the_schema_text_says_the_fields(topic: Topic) -> None:
    parsed = parse_schema(topic.schema)
    assert parsed is not None
    assert [(name, kind) for name, kind, _ in parsed] == [
        (name, kind) for name, kind, _ in topic.fields
    ]


@pytest.mark.parametrize(
    "text", ["float64[3] xyz", "geometry_msgs/Vector3 force", "wstring s", "", "# nothing\n"]
)
def test_a_schema_that_is_not_of_plain_fields_is_not_guessed_at(text: str) -> None:
    assert parse_schema(text) is None


def test_a_foreign_schema_with_constants_defaults_and_comments_is_read() -> None:
    text = (
        "uint8 OK=1\n\nbuiltin_interfaces/msg/Time stamp # when\n"
        "float32 x 1.5\nbyte flags\nstring<=10 who\n"
    )
    assert parse_schema(text) == (
        ("stamp", TIME, "when"),
        ("x", "float32", ""),
        ("flags", "uint8", ""),
        ("who", STRING, ""),
    )


def test_there_is_a_topic_for_every_channel_with_its_fields() -> None:
    assert {t.name: t.names for t in RAW_TOPICS} == {
        f"/raw/{c}": ("stamp", *names) for c, names in CHANNELS.items()
    }


# ---- files ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_our_reader_returns_what_was_written_in_its_order(tmp_path: Path, compression: str) -> None:
    written = write_sample(tmp_path / "a.mcap", compression=compression)
    recording = read(tmp_path / "a.mcap")
    assert list(recording.messages()) == written
    assert recording.complete and not recording.damage and recording.unverified == 0
    assert recording.config_yaml == "wheel: {radius: 0.072}\n"
    assert recording.run == RunInfo("sample", 40.0, notes="ä")
    assert recording.versions["numpy"]


def test_arrays_equal_the_messages(tmp_path: Path) -> None:
    written = write_sample(tmp_path / "a.mcap")
    recording = read(tmp_path / "a.mcap")
    for topic in (*RAW_TOPICS, MIXED):
        rows = recording.arrays(topic.name)
        expected = [
            (t, order, *values)
            for order, (name, t, values) in enumerate(written)
            if name == topic.name
        ]
        assert rows.dtype.names == ("log_time", "order", *topic.names)
        assert rows.tolist() == expected


def test_a_topic_without_messages_is_an_empty_array_and_an_unknown_or_textual_one_an_error(
    tmp_path: Path,
) -> None:
    RunWriter(tmp_path / "a.mcap", [], "", RunInfo()).close()
    recording = read(tmp_path / "a.mcap")
    assert recording.complete and recording.arrays("/raw/wrench")["fx"].shape == (0,)
    with pytest.raises(RecordingError, match="/nothing"):
        recording.arrays("/nothing")
    write_sample(tmp_path / "b.mcap")
    with pytest.raises(RecordingError, match="/log"):
        read(tmp_path / "b.mcap").arrays("/log")


def test_the_mcap_library_agrees_value_for_value(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    ros2 = pytest.importorskip("mcap_ros2.decoder", reason="mcap-ros2-support is not installed")
    written = write_sample(tmp_path / "a.mcap")
    fields = {topic.name: topic.fields for topic in (*RAW_TOPICS, MIXED, LOG_TOPIC)}
    with open(tmp_path / "a.mcap", "rb") as file:
        opened = reader.make_reader(
            file, validate_crcs=True, decoder_factories=[ros2.DecoderFactory()]
        )
        found = []
        for _, channel, message, decoded in opened.iter_decoded_messages(log_time_order=False):
            found.append((channel.topic, message.log_time, plain(decoded, fields[channel.topic])))
        assert found == written
        metadata = {m.name: m.metadata for m in opened.iter_metadata()}
        assert metadata["gritd.config"]["yaml"] == "wheel: {radius: 0.072}\n"
        assert metadata["gritd.run"]["nominal_load"] == "40.0"
        assert opened.get_summary().statistics.message_count == len(written)


def test_the_mcap_library_seeks_by_our_index(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    written = write_sample(tmp_path / "a.mcap")
    start, end = T0 + 5_000_000, T0 + 9_000_000
    with open(tmp_path / "a.mcap", "rb") as file:
        opened = reader.make_reader(file)
        found = [
            m.log_time
            for _, _, m in opened.iter_messages(
                ["/raw/wheel_encoder"], starting_at=start, ending_before=end
            )
        ]
    assert found == [
        t for name, t, _ in written if name == "/raw/wheel_encoder" and start <= t < end
    ]


def test_rosbags_agrees_value_for_value(tmp_path: Path) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    typesys = pytest.importorskip("rosbags.typesys")
    written = write_sample(tmp_path / "a.mcap")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    fields = {topic.name: topic.fields for topic in (*RAW_TOPICS, MIXED, LOG_TOPIC)}
    for topic in (*RAW_TOPICS, MIXED):
        store.register(
            typesys.get_types_from_msg(topic.schema.split("=" * 80)[0], topic.schema_name)
        )
    with rosbag2.Reader(tmp_path / "a.mcap") as reader:
        found = [
            (
                connection.topic,
                time,
                plain(store.deserialize_cdr(data, connection.msgtype), fields[connection.topic]),
            )
            for connection, time, data in reader.messages()
        ]
    assert sorted(found) == sorted(written)


def plain(message: object, fields: tuple[tuple[str, str, str], ...]) -> tuple[object, ...]:
    values = [getattr(message, name) for name, _, _ in fields]
    kinds = [kind for _, kind, _ in fields]
    return tuple(
        v.sec * BILLION + v.nanosec if k == TIME else v for v, k in zip(values, kinds, strict=True)
    )


def test_an_unclosed_file_has_configuration_and_run_and_all_that_was_flushed(
    tmp_path: Path,
) -> None:
    written = write_sample(tmp_path / "a.mcap", close=False)
    recording = read(tmp_path / "a.mcap")
    assert list(recording.messages()) == written
    assert recording.config_yaml and recording.run.name == "sample"
    assert not recording.closed and not recording.damage


def test_an_existing_file_is_refused_and_left_alone(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"precious")
    with pytest.raises(RecordingError, match=r"a\.mcap: cannot create: File exists"):
        RunWriter(tmp_path / "a.mcap", [], "", RunInfo())
    assert (tmp_path / "a.mcap").read_bytes() == b"precious"


def test_a_message_that_does_not_fit_its_topic_is_named_and_the_file_goes_on(
    tmp_path: Path,
) -> None:
    writer = RunWriter(tmp_path / "a.mcap", [MIXED], "", RunInfo())
    with pytest.raises(ValueError, match=r"/mixed: .*does not fit"):
        writer.message("/mixed", T0, ("not a time", *mixed_values(0)[1:]))
    with pytest.raises(ValueError, match="/other: not a topic"):
        writer.message("/other", T0, ())
    writer.message("/mixed", T0, mixed_values(1))
    writer.flush()
    recording = read(tmp_path / "a.mcap")
    assert list(recording.messages()) == [("/mixed", T0, mixed_values(1))] and not recording.damage


def test_topics_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    other = Topic("/mixed2", MIXED.schema_name, MIXED.fields[:3])
    with pytest.raises(ValueError, match="/mixed2"):
        RunWriter(tmp_path / "a.mcap", [MIXED, other], "", RunInfo())


def test_a_long_recording_is_cut_into_chunks_by_itself(tmp_path: Path) -> None:
    writer = RunWriter(tmp_path / "a.mcap", [], "", RunInfo(), chunk_size=10_000)
    for i in range(1000):
        writer.reading(reading_of("wrench", i))
    writer.close()
    recording = read(tmp_path / "a.mcap")
    assert recording.counts["/raw/wrench"] == 1000 and len(list(recording.chunks())) > 5


@given(
    st.builds(
        RunInfo,
        name=st.text(),
        nominal_load=st.none() | st.floats(0, 1e3),
        pass_number=st.integers(1, 99),
        start_position=st.floats(-10, 10),
        notes=st.text(),
        part=st.integers(0, 9),
        lost_before=st.integers(0, 10**9),
    )
)
def test_run_metadata_comes_back(run: RunInfo) -> None:
    assert RunInfo.from_entries({"extra": "ignored", **run.entries()}) == (run, [])


def test_parts_are_found_in_order(tmp_path: Path) -> None:
    first = tmp_path / "run.mcap"
    for part in (0, 1, 2, 4):
        part_path(first, part).touch()
    assert [p.name for p in parts(first)] == ["run.mcap", "run.1.mcap", "run.2.mcap"]


UNSIGNED = st.integers(0, 2**64 - 1)
LENGTHS = st.dictionaries(st.integers(0, 2**16 - 1), st.integers(15, 10**6), max_size=5)
CHUNKS = st.lists(
    st.tuples(st.integers(0, 100), st.integers(60, 10**9), UNSIGNED, UNSIGNED, UNSIGNED, LENGTHS)
)


@given(CHUNKS)
def test_the_index_in_memory_gives_back_every_record(
    chunks: list[tuple[int, int, int, int, int, dict[int, int]]],
) -> None:
    """Whatever the times are, and however often it is read."""
    indexes, written, position = ChunkIndexes("zstd"), [], 0
    for gap, length, first, last, size, lengths in chunks:
        start = position + gap
        offsets, position = {}, start + length
        for channel, taken in lengths.items():
            offsets[channel] = position
            position += taken
        indexes.add(start, length, (first, last), size, list(lengths.items()))
        ended = position - start - length
        written.append(
            ChunkIndex(length, start, "zstd", length - 53, last, ended, offsets, first, size)
        )
        assert b"".join(indexes.records()) == record_bytes(*written)
    assert indexes.count == len(chunks)
