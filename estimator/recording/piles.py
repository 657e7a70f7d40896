"""Neighbouring blocks of a recording read as one: what a call costs is paid once for thousands of
messages.

A pile is opened only where all of it is as it should be: every block unpacks and its checksum
holds, messages lie end to end behind its definitions, each of them fits its fields. Where anything
is not so the pile stays closed, and its blocks are read one by one, which tells what is wrong and
keeps the rest.

Compiled, the messages are walked from head to head. numpy, which cannot walk, takes their places
from the message index and proves them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise
from typing import BinaryIO, NamedTuple

import numpy as np
from mcap.opcode import Opcode

from gritd.estimator.compiled import records
from gritd.estimator.limits import limits
from gritd.estimator.recording.blocks import Block, Damaged, Unpacker
from gritd.estimator.recording.blocks import records as records_of
from gritd.estimator.recording.cdr import Rows
from gritd.estimator.recording.decoding import CDR_LE, PADDING, MessageHeads, RecordedChannel, sound
from gritd.estimator.recording.message_records import (
    MESSAGE_DTYPE,
    MESSAGE_HEAD,
    RECORD_HEAD,
    Starts,
    gather,
)
from gritd.estimator.recording.sequence import Ranges, ranges, rising

ROOM = 1 << 20  # [bytes] of a pile, unpacked
REACH = 4 << 20  # [bytes] of the file that it may lie in
_HEAD = np.dtype(  # of a message, with the first two bytes of its CDR
    {
        "names": [*(MESSAGE_DTYPE.names or ()), "kind"],
        "formats": [*(MESSAGE_DTYPE[name] for name in MESSAGE_DTYPE.names or ()), "<u2"],
        "offsets": [0, 1, 9, 11, 15, 23, MESSAGE_HEAD.size],
        "itemsize": MESSAGE_HEAD.size + 2,
    }
)
_ENTRY = 16  # [bytes] log_time and offset


_Joined = tuple[MessageHeads, Starts, Ranges, bool]


class Pile(NamedTuple):
    """The messages of some blocks."""

    chunk: MessageHeads  # of all of them
    cuts: Starts  # (blocks + 1,) the number of the first message of each block, and how many
    preambles: tuple[bytes, ...]  # (blocks) what stands before the messages of each
    numbers: Ranges

    def parts(self) -> list[MessageHeads]:
        """The messages block by block."""
        if len(self.cuts) == 2:
            return [self.chunk]
        content, starts, times = self.chunk.content, self.chunk.starts, self.chunk.times
        return [
            MessageHeads(content, starts[a:b], times=None if times is None else times[a:b])
            for a, b in pairwise(self.cuts.tolist())
        ]


def alone(chunk: MessageHeads) -> Pile:
    """A pile of one block."""
    return Pile(chunk, np.array([0, len(chunk.starts)]), (), ranges(chunk))


def opened(
    file: BinaryIO,
    blocks: Sequence[Block],
    sources: Mapping[int, RecordedChannel],
    unpacker: Unpacker,
    numbered: bool = False,
) -> Pile | None:
    """The messages of neighbouring blocks; None where anything about one of them is not as it
    should be, or nothing is compiled and its writer left no message index. numbered: each message
    should have a later number than the one of its channel before it.
    """
    reach = max(b.start + b.stored for b in blocks) - min(b.start for b in blocks)
    if reach > 2 * max(int(limits().chunk), REACH):
        return None
    content = unpacker.joined(file, blocks)
    if content is None:
        return None

    ends = np.cumsum([block.size for block in blocks])
    joined = (
        _walked(content, ends, sources)
        if records.BUILT
        else _pointed(content, ends, _indexes(file, blocks), sources)
    )
    if joined is None:
        return None

    chunk, cuts, numbers, in_order = joined
    if numbered and not in_order:
        return None
    edges = zip(_bases(ends).tolist(), chunk.starts[cuts[:-1]].tolist(), strict=True)
    return Pile(chunk, cuts, tuple(bytes(content[a:b]) for a, b in edges), numbers)


def _bases(ends: Starts) -> Starts:
    """Where blocks begin that are joined and end there."""
    return np.append(0, ends[:-1])


def _walked(
    content: memoryview, ends: Starts, sources: Mapping[int, RecordedChannel]
) -> _Joined | None:
    """The messages of joined blocks that end at `ends`, the cuts between them, their numbers and
    whether these rise, by walking from head to head.
    """
    sizes = np.full(max(sources, default=0) + 1, records.UNKNOWN, np.int64)
    for channel, source in sources.items():
        flat = source.codec is not None and source.codec.flat
        sizes[channel] = source.codec.size if source.codec and flat else records.NOT_FIXED

    walked = records.walk(content, ends, sizes)
    if walked is None:
        return None

    starts, cuts, places, numbers, in_order = walked
    order = np.frombuffer(places, np.int64)
    edges = pairwise(accumulate((count for _, _, count in numbers.values()), initial=0))
    groups = {channel: order[a:b] for channel, (a, b) in zip(numbers, edges, strict=True)}
    chunk = MessageHeads(content, np.frombuffer(starts, np.int64), groups)

    loose = (channel for channel in groups if sizes[channel] == records.NOT_FIXED)
    if not all(np.all(sound(chunk, groups[channel], sources[channel])) for channel in loose):
        return None
    return chunk, np.frombuffer(cuts, np.int64), numbers, in_order


def _pointed(
    content: memoryview,
    ends: Starts,
    indexes: Sequence[tuple[int, bytes]],
    sources: Mapping[int, RecordedChannel],
) -> _Joined | None:
    """The same, where the message indexes point to."""
    bases = _bases(ends)
    starts = _starts(indexes, bases, len(content))
    if starts is None:
        return None

    cuts = np.append(np.searchsorted(starts, bases), len(starts))
    if np.any(cuts[:-1] >= cuts[1:]):  # a block without messages
        return None
    heads = gather(content, starts, _HEAD)
    if not _tiled(starts, heads, cuts, ends):
        return None

    chunk = MessageHeads(content, starts)
    return (chunk, cuts, ranges(chunk), rising(chunk)) if _sound(chunk, heads, sources) else None


def _sound(chunk: MessageHeads, heads: Rows, sources: Mapping[int, RecordedChannel]) -> bool:
    """Whether every message is of a known channel and fits its fields: `decoding.sound` of all
    channels at once.
    """
    if not sources.keys() >= chunk.groups.keys():
        return False

    size = np.full(max(chunk.groups) + 1, -1)  # of a channel's messages; -1: of no fixed size
    for channel, own in chunk.groups.items():
        codec = sources[channel].codec
        if codec is not None and codec.flat:
            size[channel] = codec.size
        elif not np.all(sound(chunk, own, sources[channel])):
            return False

    expected = size[heads["channel"]]
    excess = heads["length"].astype(np.int64) - (MESSAGE_HEAD.size - RECORD_HEAD.size)
    excess -= expected
    fits = (excess >= 0) & (excess <= PADDING) & (heads["kind"] == CDR_LE)
    return bool(np.all(fits | (expected < 0)))


def _indexes(file: BinaryIO, blocks: Sequence[Block]) -> list[tuple[int, bytes]]:
    """(number of the block, entries) of every message index, none where one cannot be read."""
    indexes = list[tuple[int, bytes]]()
    for number, block in enumerate(blocks):
        first, end = block.indexes
        file.seek(first)
        data = file.read(min(end - first, int(limits().chunk)))
        try:
            found = [data[start + 6 : stop] for _, start, stop in records_of(data)]
        except Damaged:
            return []
        if not found:
            return []
        indexes += [(number, entries) for entries in found]

    return indexes


def _starts(indexes: Sequence[tuple[int, bytes]], bases: Starts, size: int) -> Starts | None:
    """Where messages begin in the joined blocks (n,), ascending, as the message indexes say; None
    where one points outside.
    """
    entries = b"".join(index for _, index in indexes)
    if not entries or len(entries) % _ENTRY:
        return None

    offsets = np.frombuffer(entries, "<i8")[1::2]
    counts = [len(index) // _ENTRY for _, index in indexes]
    starts = offsets + np.repeat(bases[[number for number, _ in indexes]], counts)
    starts.sort(kind="stable")  # each index is ascending: they are merged, seven times faster
    return starts if starts[0] >= 0 and starts[-1] <= size - _HEAD.itemsize else None


def _tiled(starts: Starts, heads: Rows, cuts: Starts, ends: Starts) -> bool:
    """Whether messages, and nothing else, lie end to end from the first of each block to its
    end.
    """
    following = np.append(starts[1:], ends[-1])
    following[cuts[1:] - 1] = ends
    lengths = heads["length"].astype(np.int64)

    return bool(
        np.array_equal(starts + lengths + RECORD_HEAD.size, following)
        and np.all(heads["opcode"] == Opcode.MESSAGE)
        and lengths.min() >= MESSAGE_HEAD.size - RECORD_HEAD.size
    )
