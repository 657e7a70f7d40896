"""Read a recording: closed or not, cut at any byte, with flipped bits, or written by somebody
else.

Every chunk is unpacked and checked once by `read`; what cannot be trusted is left out and named
in `damage`, one line each. What `messages` and `arrays` give afterwards comes from intact chunks
only, in file order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.blocks import (
    MAX_CHUNK,
    MAX_WASTE,
    Block,
    Contents,
    Damaged,
    Texts,
    Walk,
    records,
    split,
    unpack,
)
from gritd.estimator.recording.cdr import CODES, TIME, Codec, Rows, Topic, parse_schema
from gritd.estimator.recording.decoding import Chunk, Source, select
from gritd.estimator.recording.mcapfile import LIBRARY, RecordingError, Starts, opened, reported
from gritd.estimator.recording.metadata import CHECKSUM, CONFIG, RECOVERED, RUN, seal_holds
from gritd.estimator.recording.topics import RAW_TOPICS

# [bytes] unpacked chunks kept for the next pass; a longer recording is unpacked again
MAX_KEPT = 64 << 20
MAX_LINES = 100
_COST = 100  # [bytes] that could be read in the time one message takes that then is not good

Message = tuple[str, int, tuple[Any, ...]]


@dataclass
class Recording:
    """A recording that was checked; made by `read`."""

    path: Path
    config_yaml: str | None = None  # the effective configuration, if it is intact
    versions: dict[str, str] = field(default_factory=dict)  # of what wrote it
    run: RunInfo = field(default_factory=RunInfo)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)  # all intact records
    damage: list[str] = field(default_factory=list)  # what is not right, one line each
    closed: bool = False  # ends with an intact index
    lost: int = 0  # messages known to be missing, by the file's own count
    counted: bool = (
        False  # the file says how many messages it had, so that `lost` is all that is lost
    )
    unverified: int = 0  # messages under no checksum; other writers may leave such
    attachments: int = 0
    counts: Counter[str] = field(default_factory=Counter)  # messages by topic
    sources: dict[int, Source] = field(default_factory=dict)  # by channel number
    _blocks: list[Block] = field(default_factory=list, repr=False)
    _kept: dict[int, Chunk] = field(default_factory=dict, repr=False)

    @property
    def complete(self) -> bool:
        """Closed, and nothing is missing."""
        return self.closed and not self.damage

    @property
    def saved(self) -> bool:
        """Nothing that was written is lost, though the file may be unclosed or its index
        damaged.
        """
        return not self.damage or (
            self.counted and not self.lost and {CONFIG, RUN} <= self.metadata.keys()
        )

    @property
    def recovered(self) -> dict[str, str]:
        """What `gritd recover` noted when it made this file; empty for an original."""
        return self.metadata.get(RECOVERED, {})

    @property
    def topics(self) -> dict[str, Topic]:
        """The topics that can be decoded, by name."""
        return {source.topic.name: source.topic for source in self.sources.values() if source.codec}

    def chunks(self) -> Iterator[Chunk]:
        """The good messages, block by block in file order, still encoded."""
        with reported(self.path, "read"), opened(self.path) as file:
            for number, block in enumerate(self._blocks):
                yield self._kept.get(number) or self._chunk(file, block)

    def messages(self) -> Iterator[Message]:
        """(topic, log_time [ns], values) in file order; values in the order of the topic's
        fields.
        """
        for chunk in self.chunks():
            rows: dict[int, Message] = {}
            for channel, own in chunk.groups.items():
                source = self.sources[channel]
                if source.codec:
                    times = chunk.heads["log_time"][own].tolist()
                    for i, time, values in zip(
                        own.tolist(), times, source.values(chunk, own), strict=True
                    ):
                        rows[i] = (source.topic.name, time, values)
            yield from (rows[i] for i in sorted(rows))

    def arrays(self, topic: str) -> Rows:
        """All messages of a topic as one structured array, shape (n,), in file order.

        Fields: log_time [ns]; order, the place of the message among all of the file, which tells
        what came before what; then the topic's, a stamp as int64 [ns]. Without messages it is
        empty. Raises RecordingError for a topic whose messages are not of fixed size or not
        decoded.
        """
        known = self.topics.get(topic) or next((t for t in RAW_TOPICS if t.name == topic), None)
        if known is None or not known.codec.flat:
            raise RecordingError(
                f"{self.path}: {topic}: no topic with decoded fields of fixed size"
            )
        tables = [np.empty(0, [("log_time", "<i8"), ("order", "<i8"), *known.codec.table_dtype])]
        before = 0
        for chunk in self.chunks():
            for channel, own in chunk.groups.items():
                if self.sources[channel].topic.name == topic:
                    tables.append(
                        _table(self.sources[channel], chunk, own, before, tables[0].dtype)
                    )
            before += len(chunk.starts)
        joined = np.concatenate(tables)
        return joined[np.argsort(joined["order"], kind="stable")]

    def _chunk(self, file: BinaryIO, block: Block) -> Chunk:
        content = unpack(file, block)
        return select(content, split(file, block, content)[0], self.sources)[0]


def _table(
    source: Source, chunk: Chunk, own: Starts, before: int, dtype: np.dtype[np.void]
) -> Rows:
    table = np.empty(own.shape, dtype)
    table["log_time"] = chunk.heads["log_time"][own]
    table["order"] = own + before
    source.fill(table[list(source.topic.names)], chunk, own)
    return table


def read(path: Path | str, topics: Iterable[Topic] = RAW_TOPICS) -> Recording:
    """Open a recording and check all of it.

    `topics` are those whose fields the caller relies on; all others are taken as the file
    defines them. Raises RecordingError if there is no such file, it is no MCAP file, or one of
    `topics` lacks a field in it.
    """
    path = Path(path)
    with reported(path, "read"), opened(path) as file:
        try:
            contents = Walk(file, path.stat().st_size).run()
        except RecordingError as error:
            raise RecordingError(f"{path}: {error}") from None
        recording = _with_metadata(
            Recording(path, damage=contents.damage, closed=contents.closed), contents
        )
        check = _Check(recording, {topic.name: topic for topic in topics})
        check.whole(file, contents)
    if len(recording.damage) > MAX_LINES:
        recording.damage[MAX_LINES:] = [f"and {len(recording.damage) - MAX_LINES} more places"]
    return recording


def _with_metadata(recording: Recording, contents: Contents) -> Recording:
    recording.attachments = contents.attachments
    for name, entries in contents.metadata.items():
        if seal_holds(
            name,
            entries,
            required=contents.library.startswith(LIBRARY) and name.startswith("gritd."),
        ):
            recording.metadata[name] = entries
        else:
            recording.damage.append(f"metadata {name}: its checksum does not hold; ignored")
    if contents.library == LIBRARY:
        recording.damage += [
            f"metadata {name} is missing"
            for name in (CONFIG, RUN)
            if name not in recording.metadata
        ]
    config = dict(recording.metadata.get(CONFIG, {}))
    recording.config_yaml = config.pop("yaml", None)
    recording.versions = {key: value for key, value in config.items() if key != CHECKSUM}
    try:
        recording.run = RunInfo.from_entries(recording.metadata.get(RUN, {}))
    except ValueError as error:
        recording.damage.append(f"metadata {RUN}: {error}")
    return recording


class _Check:
    """The one pass that decides what is good: fills in a Recording's sources, blocks, counts and
    damage.
    """

    def __init__(self, recording: Recording, known: dict[str, Topic]) -> None:
        self._recording = recording
        self._known = known
        self._schemas: dict[int, Schema] = {}
        self._seen: set[tuple[int, bytes]] = set()  # definitions are repeated in every chunk
        self._numbers: dict[
            int, list[int]
        ] = {}  # channel -> first and last sequence number, messages
        self._waste = 0
        self._room = MAX_KEPT

    def whole(self, file: BinaryIO, contents: Contents) -> None:
        expected = self._summary(contents.summary)
        for block in contents.blocks:
            try:
                self._block(file, block)
            except Damaged as why:
                self._recording.damage.append(
                    f"byte {block.start}: chunk of {block.stored} bytes skipped: {why}"
                )
                self._waste += block.stored + min(block.size, MAX_CHUNK)
            if self._waste > MAX_WASTE:
                self._recording.damage.append(
                    f"byte {block.start}: too much damage; the rest is not read"
                )
                break
        self._count_lost(expected, numbered=contents.library == LIBRARY)

    def _block(self, file: BinaryIO, block: Block) -> None:
        content = unpack(file, block)
        starts, definitions = split(file, block, content)
        for opcode, start, end in definitions:
            self._define(opcode, content[start:end])
        chunk, complaints = select(content, starts, self._recording.sources)
        self._recording.damage += [f"byte {block.start}: {complaint}" for complaint in complaints]
        self._waste += _COST * (len(starts) - len(chunk.starts))
        self._keep(block, chunk)

    def _keep(self, block: Block, chunk: Chunk) -> None:
        recording = self._recording
        self._room -= len(chunk.content)
        if self._room >= 0:
            recording._kept[len(recording._blocks)] = chunk
        recording._blocks.append(block)
        recording.unverified += 0 if block.crc else len(chunk.starts)
        for channel, own in chunk.groups.items():
            numbers = chunk.heads["sequence"][own]
            recording.counts[recording.sources[channel].topic.name] += len(numbers)
            entry = self._numbers.setdefault(channel, [int(numbers[0]), 0, 0])
            entry[1:] = [int(numbers[-1]), entry[2] + len(numbers)]

    def _summary(self, summary: bytes) -> dict[int, int]:
        """Take the definitions of the summary; return its count of messages by channel, if it
        has one.
        """
        expected: dict[int, int] = {}
        try:
            for opcode, start, end in records(summary):
                if opcode == Opcode.STATISTICS:
                    expected = _channel_counts(summary[start:end])
                elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                    self._define(opcode, summary[start:end])
        except Damaged:  # only the first part of a very long summary is read
            pass
        return expected

    def _count_lost(self, expected: dict[int, int], numbered: bool) -> None:
        if expected:
            self._recording.counted = True
            counted = {channel: entry[2] for channel, entry in self._numbers.items()}
            lost = sum(
                max(0, count - counted.get(channel, 0)) for channel, count in expected.items()
            )
        else:
            lost = (
                sum(last - first + 1 - count for first, last, count in self._numbers.values())
                if numbered
                else 0
            )
        self._recording.lost = max(0, lost)
        if lost > 0:
            self._recording.damage.insert(0, f"{lost} messages are missing")

    def _define(self, opcode: int, body: bytes) -> None:
        """A schema or a channel. Raises Damaged where it contradicts an earlier one,
        RecordingError where it lacks a field that the caller relies on.
        """
        if (opcode, body) in self._seen:
            return
        fields = Texts(body)
        if opcode == Opcode.SCHEMA:
            schema = Schema(
                id=fields.integer(2), name=fields.text(), encoding=fields.text(), data=fields.blob()
            )
            fields.finish()
            if self._schemas.setdefault(schema.id, schema) != schema:
                raise Damaged(f"schema {schema.id} is defined twice, differently")
        else:
            number, schema_number = fields.integer(2), fields.integer(2)
            channel = Channel(number, fields.text(), fields.text(), fields.table(), schema_number)
            fields.finish()
            self._define_channel(channel)
        self._seen.add((opcode, body))

    def _define_channel(self, channel: Channel) -> None:
        sources = self._recording.sources
        if channel.id not in sources:
            sources[channel.id] = self._source(channel)
        elif sources[channel.id].channel != channel:
            raise Damaged(f"channel {channel.id} is defined twice, differently")

    def _source(self, channel: Channel) -> Source:
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id:
            raise Damaged(
                f"channel {channel.id} refers to schema {channel.schema_id}, which is missing"
            )
        fields = None
        if schema and schema.encoding == "ros2msg" and channel.message_encoding == "cdr":
            fields = parse_schema(schema.data.decode(errors="replace"))
        known = self._known.get(channel.topic)
        codec = Codec(fields) if fields else None
        if known:
            _require(self._recording.path, known, codec)
        return Source(
            schema,
            channel,
            known or Topic(channel.topic, schema.name if schema else "", fields or ()),
            codec,
        )


def _require(path: Path, known: Topic, codec: Codec | None) -> None:
    """Raises RecordingError, one line, unless the file's fields hold those of the topic."""
    expected = ", ".join(f"{kind} {name}" for name, kind, _ in known.fields)
    if codec is None or (known.codec.flat and not codec.flat):
        raise RecordingError(
            f"{path}: {known.name}: not CDR with a flat ros2msg schema; expected {expected}"
        )
    for name, kind, _ in known.fields:
        found = dict(zip(codec.names, codec.kinds, strict=True)).get(name)
        if found is None:
            raise RecordingError(f"{path}: {known.name}: no field {name!r}; expected {expected}")
        if not _fits(found, kind):
            raise RecordingError(
                f"{path}: {known.name}: field {name!r} is {found}; expected {kind}"
            )


def _fits(found: str, expected: str) -> bool:
    """Whether values of one ROS type can stand for another without becoming something else."""
    if found == expected:
        return True
    if found not in CODES or expected not in CODES:
        return {found, expected} == {TIME, "int64"}
    return np.can_cast(np.dtype(CODES[found]), np.dtype(CODES[expected]), "same_kind")


def _channel_counts(statistics: bytes) -> dict[int, int]:
    entries = np.frombuffer(statistics[46:], [("channel", "<u2"), ("count", "<u8")])
    return {int(channel): int(count) for channel, count in entries.tolist()}
