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
from gritd.estimator.recording.blocks import Block, Unpacker
from gritd.estimator.recording.cdr import Rows
from gritd.estimator.recording.decoding import CDR_LE, PADDING, MessageHeads, RecordedChannel, sound
from gritd.estimator.recording.message_records import (
    MESSAGE_DTYPE,
    MESSAGE_HEAD,
    RECORD_HEAD,
    Starts,
    gather,
)

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
_INDEX_HEAD = 15  # [bytes] of a message index before its entries
_ENTRY = 16  # [bytes] log_time and offset

Ranges = dict[int, tuple[int, int, int]]  # channel -> first number, last number, messages


class Pile(NamedTuple):
    """The messages of some blocks."""

    chunk: MessageHeads  # of all of them
    cuts: Starts  # (blocks + 1,) the number of the first message of each block, and how many
    preambles: tuple[bytes, ...]  # (blocks) what stands before the messages of each

    def parts(self) -> list[MessageHeads]:
        """The messages block by block."""
        if len(self.cuts) == 2:
            return [self.chunk]
        edges = self.cuts.tolist()
        content, starts, heads = self.chunk.content, self.chunk.starts, self.chunk.heads
        return [MessageHeads(content, starts[a:b], heads[a:b]) for a, b in pairwise(edges)]

    def ranges(self) -> list[Ranges]:
        """The messages' numbers in each block, channel by channel."""
        numbers, groups = self.chunk.heads["sequence"], self.chunk.groups
        if len(self.cuts) == 2:
            ends = {c: (int(numbers[own[0]]), int(numbers[own[-1]])) for c, own in groups.items()}
            return [{c: (*ends[c], len(own)) for c, own in groups.items()}]

        of_blocks: list[Ranges] = [{} for _ in range(len(self.cuts) - 1)]
        block = np.repeat(np.arange(len(of_blocks)), np.diff(self.cuts))
        for channel, own in groups.items():
            last = np.append(np.flatnonzero(np.diff(block[own])), len(own) - 1)
            first = np.append(0, last[:-1] + 1)
            columns = (block[own[last]], numbers[own[first]], numbers[own[last]], last - first + 1)
            for at, begin, end, count in zip(*(c.tolist() for c in columns), strict=True):
                of_blocks[at][channel] = begin, end, count

        return of_blocks


def alone(chunk: MessageHeads) -> Pile:
    """A pile of one block."""
    return Pile(chunk, np.array([0, len(chunk.starts)]), ())


def opened(
    file: BinaryIO,
    blocks: Sequence[Block],
    sources: Mapping[int, RecordedChannel],
    unpacker: Unpacker,
) -> Pile | None:
    """The messages of neighbouring blocks; None where anything about one of them is not as it
    should be, or its writer left no message index.
    """
    contents, indexes = _unpacked(file, blocks, unpacker)
    if len(contents) < len(blocks) or not indexes:
        return None

    content = contents[0] if len(contents) == 1 else b"".join(contents)
    ends = np.cumsum([len(each) for each in contents])
    joined = (
        _walked(content, ends, sources)
        if records.BUILT
        else _pointed(content, ends, indexes, sources)
    )
    if joined is None:
        return None

    chunk, cuts = joined
    begins = (chunk.starts[cuts[:-1]] - _bases(ends)).tolist()
    return Pile(chunk, cuts, tuple(c[:b] for c, b in zip(contents, begins, strict=True)))


def _bases(ends: Starts) -> Starts:
    """Where blocks begin that are joined and end there."""
    return np.append(0, ends[:-1])


def _walked(
    content: bytes, ends: Starts, sources: Mapping[int, RecordedChannel]
) -> tuple[MessageHeads, Starts] | None:
    """The messages of joined blocks that end at `ends`, and the cuts between them, by walking from
    head to head.
    """
    sizes = np.full(max(sources, default=0) + 1, records.UNKNOWN, np.int64)
    for channel, source in sources.items():
        flat = source.codec is not None and source.codec.flat
        sizes[channel] = source.codec.size if source.codec and flat else records.NOT_FIXED

    walked = records.walk(content, ends, sizes)
    if walked is None:
        return None

    starts, heads, cuts, numbers, counts = walked
    order = np.frombuffer(numbers, np.int64)
    edges = pairwise(accumulate(counts.values(), initial=0))
    groups = {channel: order[a:b] for channel, (a, b) in zip(counts, edges, strict=True)}
    chunk = MessageHeads(
        content, np.frombuffer(starts, np.int64), np.frombuffer(heads, _HEAD), groups
    )

    loose = (channel for channel in groups if sizes[channel] == records.NOT_FIXED)
    if not all(np.all(sound(chunk, groups[channel], sources[channel])) for channel in loose):
        return None
    return chunk, np.frombuffer(cuts, np.int64)


def _pointed(
    content: bytes,
    ends: Starts,
    indexes: Sequence[tuple[int, memoryview]],
    sources: Mapping[int, RecordedChannel],
) -> tuple[MessageHeads, Starts] | None:
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

    chunk = MessageHeads(content, starts, heads)
    return (chunk, cuts) if _sound(chunk, sources) else None


def _sound(chunk: MessageHeads, sources: Mapping[int, RecordedChannel]) -> bool:
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

    expected = size[chunk.heads["channel"]]
    excess = chunk.heads["length"].astype(np.int64) - (MESSAGE_HEAD.size - RECORD_HEAD.size)
    excess -= expected
    fits = (excess >= 0) & (excess <= PADDING) & (chunk.heads["kind"] == CDR_LE)
    return bool(np.all(fits | (expected < 0)))


def _unpacked(
    file: BinaryIO, blocks: Sequence[Block], unpacker: Unpacker
) -> tuple[list[bytes], list[tuple[int, memoryview]]]:
    """The blocks' records, as far as they unpack; and (number of the block, entries) of every
    message index, none where one cannot be read.
    """
    origin = min(block.start for block in blocks)  # an index may list them in any order
    reach = max(max(b.start + b.stored, b.index[1]) for b in blocks) - origin
    if reach > 2 * max(int(limits().chunk), REACH):
        return [], []
    packed = unpacker.read(file, origin, reach)

    contents, indexes = list[bytes](), list[tuple[int, memoryview]]()
    for number, block in enumerate(blocks):
        start = block.start - origin
        content = unpacker.whole(block, packed[start : start + block.stored])
        first, end = (place - origin for place in block.index)
        if content is None or not 0 < first < end <= len(packed):
            break
        contents.append(content)
        while first < end:
            if first + _INDEX_HEAD > end:
                return contents, []
            after = first + RECORD_HEAD.size + RECORD_HEAD.unpack_from(packed, first)[1]
            if after > end:
                return contents, []
            indexes.append((number, packed[first + _INDEX_HEAD : after]))
            first = after

    return contents, indexes


def _starts(indexes: Sequence[tuple[int, memoryview]], bases: Starts, size: int) -> Starts | None:
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
