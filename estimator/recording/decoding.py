"""From the bytes of a block to values: one channel's definition in the file, and the messages of
one block.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from gritd.estimator.recording.cdr import Codec, Rows, Topic
from gritd.estimator.recording.message_records import (
    MESSAGE_DTYPE,
    MESSAGE_HEAD,
    RECORD_HEAD,
    Starts,
    gather,
)

PADDING = 7  # [bytes] some CDR writers fill a message up to a multiple of 4 or 8
# the first two bytes of the encapsulation header, 00 01, as a little-endian number
CDR_LE = 0x0100


@dataclass(frozen=True)
class RecordedChannel:
    """One channel of the file as defined there, and how to decode it; `codec` is None where we
    cannot.
    """

    schema: Schema | None
    channel: Channel
    topic: Topic  # as the caller of `read` knows it, else as the file defines it
    codec: Codec | None  # of the fields as they stand in the file

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        """Of a whole message record, its head left out."""
        assert self.codec is not None
        return self.codec.record_dtype(MESSAGE_HEAD.size)

    def fill(self, table: Rows, chunk: MessageHeads, own: Starts) -> None:
        """Decode the messages numbered `own`, shape (n,), of a chunk into a table of n rows, by
        field name.
        """
        assert self.codec is not None
        self.codec.fill(table, gather(chunk.content, chunk.starts[own], self.dtype))

    def values(self, chunk: MessageHeads, own: Starts) -> list[tuple[Any, ...]]:
        """The values of the messages numbered `own`, shape (n,): n tuples in the order of the
        topic's fields.
        """
        assert self.codec is not None
        if self.codec.flat:
            table = np.empty(own.shape, self.topic.codec.table_dtype)
            self.fill(table, chunk, own)
            return list(table.tolist())

        order = [self.codec.names.index(name) for name in self.topic.names]
        decoded = [self.codec.decode(chunk.body(i)) for i in own.tolist()]
        return [tuple(values[i] for i in order) for values in decoded]


@dataclass(frozen=True)
class MessageHeads:
    """The good messages of one block: where their records begin in `content`, shape (n,).

    known: `groups`, where they are known already; times: log times in the place of the file's [ns].
    """

    content: bytes | memoryview
    starts: Starts
    known: dict[int, Starts] | None = None
    times: NDArray[np.int64] | None = None

    @cached_property
    def heads(self) -> Rows:
        """Shape (n,)."""
        heads = gather(self.content, self.starts, MESSAGE_DTYPE)
        if self.times is not None:
            heads["log_time"] = self.times
        return heads

    def body(self, i: int) -> bytes:
        start = int(self.starts[i])
        end = start + RECORD_HEAD.size + int(self.heads["length"][i])
        return bytes(self.content[start + MESSAGE_HEAD.size : end])

    def records(self) -> tuple[bytes, Starts]:
        """The message records, heads included, end to end, and the byte offset where each begins,
        shape (n,).
        """
        sizes = self.heads["length"].astype(np.int64) + RECORD_HEAD.size
        pieces = zip(self.starts.tolist(), (self.starts + sizes).tolist(), strict=True)
        return b"".join(self.content[start:end] for start, end in pieces), np.cumsum(sizes) - sizes

    @cached_property
    def groups(self) -> dict[int, Starts]:
        """Channel number -> the numbers of its messages, shape (n,), in file order."""
        if self.known is not None:
            return self.known
        channels = self.heads["channel"]
        order = np.argsort(channels, kind="stable")
        cuts = np.flatnonzero(np.diff(channels[order])) + 1
        return {int(channels[own[0]]): own for own in np.split(order, cuts) if own.size}


def select(
    content: bytes, starts: Starts, sources: Mapping[int, RecordedChannel]
) -> tuple[MessageHeads, list[str]]:
    """The messages that are of a known channel and as long as its fields, and one line for each
    kind of others. starts: byte offsets of the records in `content`, shape (n,).
    """
    whole = MessageHeads(content, starts)

    good = np.zeros(starts.shape, bool)
    complaints = []
    for channel, own in whole.groups.items():
        source = sources.get(channel)
        good[own] = sound(whole, own, source) if source else False
        if bad := int(np.count_nonzero(~good[own])):
            what = (
                f"do not fit the fields of {source.topic.name}"
                if source
                else f"are of channel {channel}, undefined"
            )
            complaints.append(f"{bad} messages skipped: they {what}")

    return whole if good.all() else MessageHeads(content, starts[good]), complaints


def sound(chunk: MessageHeads, own: Starts, source: RecordedChannel) -> Any:
    """Which of the messages numbered `own` are little-endian CDR of the right length, shape
    (n,).
    """
    codec = source.codec
    if codec is None:
        return True
    if not codec.flat:
        return [_decodes(codec, chunk.body(i)) for i in own.tolist()]

    excess = chunk.heads["length"][own].astype(np.int64) - (
        MESSAGE_HEAD.size - RECORD_HEAD.size + codec.size
    )
    fits = (excess >= 0) & (excess <= PADDING)
    kinds = gather(
        chunk.content, chunk.starts[own[fits]] + MESSAGE_HEAD.size, np.dtype([("kind", "<u2")])
    )
    fits[fits] = kinds["kind"] == CDR_LE

    return fits


def _decodes(codec: Codec, body: bytes) -> bool:
    try:
        codec.decode(body)
    except ValueError:
        return False
    return True
