"""Schemas and channels of a file, gathered as they are met, and how to decode each channel."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from gritd.estimator.recording.blocks import Damaged, Texts, records
from gritd.estimator.recording.cdr import CODES, TIME, Codec, Field, Topic, parse_schema
from gritd.estimator.recording.decoding import RecordedChannel
from gritd.estimator.recording.mcapfile import RecordingError

ROOM = 16 << 20  # [bytes] of all definitions that differ


class Definitions:
    """The definitions of one file; `sources` by channel number.

    known: the topics whose fields the caller relies on, by name.
    """

    def __init__(self, path: Path, known: dict[str, Topic]) -> None:
        self.sources: dict[int, RecordedChannel] = {}
        self._path, self._known = path, known
        self._schemas: dict[int, Schema] = {}
        self._seen: set[tuple[int, bytes]] = set()  # definitions are repeated in every chunk
        self._room = ROOM

    def add(self, opcode: int, body: bytes) -> None:
        """A schema or a channel. Raises Damaged where it contradicts an earlier one, RecordingError
        where it lacks a field that the caller relies on.
        """
        if (opcode, body) in self._seen:
            return
        self._room -= len(body)
        if self._room < 0:
            raise Damaged(f"more than {ROOM} bytes of definitions")

        if opcode == Opcode.SCHEMA:
            self._schema(Texts(body))
        else:
            self._channel(Texts(body))
        self._seen.add((opcode, body))

    def known(self, preamble: bytes) -> bool:
        """Whether these records are definitions, and each was met before, to the byte."""
        try:
            entries = list(records(preamble))
        except Damaged:
            return False
        return all((opcode, preamble[start:end]) in self._seen for opcode, start, end in entries)

    def _schema(self, fields: Texts) -> None:
        schema = Schema(
            id=fields.integer(2), name=fields.text(), encoding=fields.text(), data=fields.blob()
        )
        fields.finish()
        if self._schemas.setdefault(schema.id, schema) != schema:
            raise Damaged(f"schema {schema.id} is defined twice, differently")

    def _channel(self, fields: Texts) -> None:
        number, schema = fields.integer(2), fields.integer(2)
        channel = Channel(number, fields.text(), fields.text(), fields.table(), schema)
        fields.finish()
        if channel.id not in self.sources:
            self.sources[channel.id] = self._source(channel)
        elif self.sources[channel.id].channel != channel:
            raise Damaged(f"channel {channel.id} is defined twice, differently")

    def _source(self, channel: Channel) -> RecordedChannel:
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id:
            raise Damaged(
                f"channel {channel.id} refers to schema {channel.schema_id}, which is missing"
            )

        fields, codec = None, None
        if schema and schema.encoding == "ros2msg" and channel.message_encoding == "cdr":
            fields, codec = _parsed(schema.data)

        known = self._known.get(channel.topic)
        if known:
            _require(self._path, known, codec)
        topic = known or Topic(channel.topic, schema.name if schema else "", fields or ())
        return RecordedChannel(schema, channel, topic, codec)


@lru_cache(maxsize=32)  # the recordings of a campaign define the same messages
def _parsed(text: bytes) -> tuple[tuple[Field, ...] | None, Codec | None]:
    """The fields of a ros2msg text, and what reads a message of them; None where nothing does."""
    fields = parse_schema(text.decode(errors="replace"))
    return fields, Codec(fields) if fields else None


def _require(path: Path, known: Topic, codec: Codec | None) -> None:
    """Raises RecordingError, one line, unless the file's fields hold those of the topic."""
    expected = ", ".join(f"{kind} {name}" for name, kind, _ in known.fields)
    if codec is None or (known.codec.flat and not codec.flat):
        raise RecordingError(
            f"{path}: {known.name}: not CDR with a flat ros2msg schema; expected {expected}"
        )

    for name, kind, _ in known.fields:
        held = dict(zip(codec.names, codec.kinds, strict=True)).get(name)
        if held is None:
            raise RecordingError(f"{path}: {known.name}: no field {name!r}; expected {expected}")
        if not _fits(held, kind):
            raise RecordingError(f"{path}: {known.name}: field {name!r} is {held}; expected {kind}")


def _fits(held: str, expected: str) -> bool:
    """Whether values of one ROS type can stand for another without becoming something else."""
    if held == expected:
        return True
    if held not in CODES or expected not in CODES:
        return {held, expected} == {TIME, "int64"}
    return np.can_cast(np.dtype(CODES[held]), np.dtype(CODES[expected]), "same_kind")
