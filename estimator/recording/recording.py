"""A recording that was checked: what is intact of it, message by message or a topic at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.attachments import AttachmentPlace
from gritd.estimator.recording.blocks import Block, Unpacker, split, unpack
from gritd.estimator.recording.cdr import Rows, Topic
from gritd.estimator.recording.decoding import MessageHeads, RecordedChannel, select
from gritd.estimator.recording.mcapfile import RecordingError, opened, reported
from gritd.estimator.recording.metadata import CONFIG, RECOVERED, RUN
from gritd.estimator.recording.piles import Pile, alone
from gritd.estimator.recording.piles import opened as open_pile
from gritd.estimator.recording.tables import Fields, Table, Tables
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
    repeated: list[tuple[str, dict[str, str]]] = field(default_factory=list)  # as metadata is
    attachments: list[AttachmentPlace] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)  # what is odd, though nothing is missing
    counts: Counter[str] = field(default_factory=Counter)  # messages by topic
    sources: dict[int, RecordedChannel] = field(default_factory=dict)  # by channel number
    _piles: list[tuple[Block, ...]] = field(default_factory=list, repr=False)
    _kept: dict[int, Pile] = field(default_factory=dict, repr=False)
    _tables: dict[tuple[str, Fields], Rows] = field(default_factory=dict, repr=False)
    _received: NDArray[np.int64] | None = field(default=None, repr=False)  # instead of log times

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

    def chunks(self) -> Iterator[MessageHeads]:
        """The good messages, block by block in file order, still encoded."""
        for pile in self._opened():
            yield from pile.parts()

    def messages(self) -> Iterator[Message]:
        """(topic, log_time [ns], values) in file order; values as the topic has its fields."""
        for pile in self._opened():
            chunk = pile.chunk
            rows: list[Message | None] = [None] * len(chunk.starts)
            for channel, own in chunk.groups.items():
                source = self.sources[channel]
                if source.codec:
                    times = chunk.heads["log_time"][own].tolist()
                    for i, time, values in zip(
                        own.tolist(), times, source.values(chunk, own), strict=True
                    ):
                        rows[i] = (source.topic.name, time, values)

            yield from (row for row in rows if row is not None)

    def arrays(self, topic: str) -> Rows:
        """All messages of a topic as one structured array, shape (n,), in file order.

        Fields: log_time [ns]; order, the place of the message among all of the file, which tells
        what came before what; then the topic's, a stamp as int64 [ns]. Without messages it is
        empty. Raises RecordingError for a topic whose messages are not of fixed size or not
        decoded.
        """
        return self.tables({topic: None})[topic]

    def own_tables(self) -> None:
        """Nobody else has the arrays that `read` has made: they may be written to."""
        for rows in self._tables.values():
            rows.flags.writeable = True

    def tables(self, wanted: Mapping[str, Fields]) -> dict[str, Rows]:
        """Several topics at once, each as `arrays` gives it, shape (n,) by topic, in one pass over
        the file; of its fields the named ones, or all for None. The arrays are read-only where
        `read` was asked for the same topic and fields: they were made then. Raises RecordingError.
        """
        known = {topic: self._known(topic) for topic in wanted}
        made = {
            topic: self._tables[topic, fields]
            for topic, fields in wanted.items()
            if (topic, fields) in self._tables
        }
        rest = {topic: fields for topic, fields in wanted.items() if topic not in made}
        tables = Tables(rest)
        tables.expected = self.counts

        if any(self.counts[topic] for topic in rest):
            before = 0
            for pile in self._opened():
                tables.add(pile.chunk, self.sources, before)
                before += len(pile.chunk.starts)

        for topic in tables.refused:
            names = ", ".join(rest[topic] or ()) or "the same fields"
            raise RecordingError(f"{self.path}: {topic}: not all of its messages have {names}")

        passed = {topic: rows for (topic, _), rows in tables.done().items()}
        empty = {
            topic: Table(known[topic], fields).done()
            for topic, fields in rest.items()
            if topic not in passed
        }
        for rows in (*passed.values(), *empty.values()):
            rows.flags.writeable = True  # nobody else has them
            self._set_times(rows)
        return {**empty, **passed, **made}

    def _known(self, topic: str) -> Topic:
        """Raises RecordingError for a topic without decoded fields of fixed size."""
        known = self.topics.get(topic) or next((t for t in RAW_TOPICS if t.name == topic), None)
        if known is None or not known.codec.flat:
            raise RecordingError(
                f"{self.path}: {topic}: no topic with decoded fields of fixed size"
            )
        return known

    def _set_times(self, rows: Rows) -> None:
        """Of rows as `arrays` gives them, where the file's log times are no times."""
        if self._received is not None:
            rows["log_time"] = self._received[rows["order"]]

    def _opened(self) -> Iterator[Pile]:
        """Pile by pile in file order."""
        if self._received is None:
            yield from self._stored()
            return
        before = 0
        for pile in self._stored():
            after = before + len(pile.chunk.starts)
            yield pile._replace(chunk=replace(pile.chunk, times=self._received[before:after]))
            before = after

    def _stored(self) -> Iterator[Pile]:
        """The piles as they stand in the file."""
        with reported(self.path, "read"), opened(self.path, buffering=0) as file:
            unpacker = Unpacker()
            for number, blocks in enumerate(self._piles):
                pile = self._kept.get(number) or open_pile(file, blocks, self.sources, unpacker)
                if pile is not None:
                    yield pile
                    continue
                for block in blocks:
                    yield alone(self._chunk(file, block))

    def _chunk(self, file: BinaryIO, block: Block) -> MessageHeads:
        content = unpack(file, block)
        return select(content, split(content)[0], self.sources)[0]
