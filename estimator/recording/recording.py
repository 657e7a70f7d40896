"""A recording that was checked: what is intact of it, message by message or a topic at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.blocks import Block, split, unpack
from gritd.estimator.recording.cdr import Rows, Topic
from gritd.estimator.recording.decoding import Chunk, Source, select
from gritd.estimator.recording.mcapfile import RecordingError, Starts, opened, reported
from gritd.estimator.recording.metadata import CONFIG, RECOVERED, RUN
from gritd.estimator.recording.topics import RAW_TOPICS

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
    counted: bool = False  # the file says how many messages it had: `lost` is all that is lost
    misplaced: int = 0  # chunks that stand in another place than they were written to, or twice
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
        """Nothing written is lost, though the file may be unclosed or its index damaged."""
        whole = self.counted and not self.lost and {CONFIG, RUN} <= self.metadata.keys()
        return not self.damage or (whole and not self.misplaced)

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
        """(topic, log_time [ns], values) in file order; values as the topic has its fields."""
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
