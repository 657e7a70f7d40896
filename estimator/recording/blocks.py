"""The pieces that a recording is read in: the fields of a record, and blocks of messages with their
definitions.

Every length is held against the lengths inside its record before it is believed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import BinaryIO, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import zstandard
from mcap.opcode import Opcode

from gritd.estimator.compiled.arithmetic import integer_sum
from gritd.estimator.compiled.records import crc32
from gritd.estimator.limits import limits
from gritd.estimator.recording.message_records import (
    MESSAGE_HEAD,
    RECORD_HEAD,
    Starts,
)

MAX_WINDOW = 64 << 20  # [bytes] that unpacking may look back
MAX_RATIO = 1000  # a chunk that claims to unpack to more than this many times its size is a bomb


class Damaged(Exception):
    """A record or a chunk that cannot be trusted; the message says why."""


class Block(NamedTuple):
    """Records of messages and their definitions: a chunk, or a run of unchunked records
    (compression "", crc 0).
    """

    start: int  # of the stored bytes in the file
    stored: int  # how many they are
    size: int  # how many they are unpacked
    crc: int  # of the unpacked bytes; 0: the writer gave none
    compression: str
    indexes: tuple[int, int] = (0, 0)  # where they stand in the file; under no checksum: a hint


class Texts:
    """Reads length-prefixed fields of a record; raises Damaged where one runs over the end."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.position = 0

    def integer(self, size: int) -> int:
        return int.from_bytes(self.take(size), "little")

    def take(self, size: int) -> bytes:
        end = self.position + size
        if end > len(self.data):
            raise Damaged("a length inside the record exceeds it")
        taken = self.data[self.position : end]
        self.position = end
        return taken

    def blob(self) -> bytes:
        return self.take(self.integer(4))

    def text(self) -> str:
        try:
            return self.blob().decode()
        except UnicodeDecodeError:
            raise Damaged("a text inside the record is not UTF-8") from None

    def table(self) -> dict[str, str]:
        entries = Texts(self.blob())
        table: dict[str, str] = {}
        while entries.position < len(entries.data):
            key = entries.text()
            table[key] = entries.text()
        return table

    def finish(self) -> None:
        if self.position != len(self.data):
            raise Damaged("the record is longer than its fields")


class Room:
    """One piece of memory that is used again and again: new memory comes page by page, which takes
    as long as unpacking into it.
    """

    def __init__(self) -> None:
        self._bytes = bytearray()

    def of(self, size: int) -> memoryview:
        """So many bytes, until the next call."""
        if len(self._bytes) < size:
            self._bytes = bytearray(1 << (size - 1).bit_length())  # seldom again
        return memoryview(self._bytes)[:size]

    def read(self, file: BinaryIO, start: int, size: int) -> memoryview:
        """`size` bytes of the file from `start` on, or as many as there are; until the next
        call.
        """
        view = self.of(size)
        return view[: os.preadv(file.fileno(), [view], start)]


class Unpacker:
    """Reads and unpacks block after block with one zstd context, which costs as much as a small
    block. `last`: what it unpacked is needed no longer when it unpacks more.
    """

    def __init__(self, last: bool = False) -> None:
        self.last = last
        self._packed, self._content = Room(), Room()
        self._zstd = zstandard.ZstdDecompressor(max_window_size=MAX_WINDOW)
        self._largest = int(limits().chunk)

    def joined(self, file: BinaryIO, blocks: Sequence[Block]) -> memoryview | None:
        """The records of neighbouring blocks end to end, their checksums verified; None where one
        is not as it should be, and `unpack` says why.
        """
        if any(too_large(block, self._largest) for block in blocks):
            return None
        start = min(block.start for block in blocks)  # an index may list them in any order
        stored = self._packed.read(file, start, max(b.start + b.stored for b in blocks) - start)
        size = integer_sum(block.size for block in blocks)
        content = self._content.of(size) if self.last else memoryview(bytearray(size))

        end = 0
        for block in blocks:
            begin, end = end, end + block.size
            data = stored[block.start - start : block.start - start + block.stored]
            if not self._into(content[begin:end], block, data):
                return None
        return content

    def _into(self, room: memoryview, block: Block, data: memoryview) -> bool:
        """Whether a block was unpacked, as its head says, into room of its size."""
        if len(data) != block.stored:
            return False

        try:
            # what a frame says of its size is taken at its word
            if block.compression == "zstd" and zstandard.frame_content_size(data) == block.size:
                with self._zstd.stream_reader(data) as reader:
                    size = reader.readinto(room)
            else:
                content = _decompress(block, bytes(data))
                size = len(content)
                room[:] = content[: len(room)]
        except (Damaged, zstandard.ZstdError, ValueError):
            return False

        return size == block.size and (not block.crc or crc32(room) == block.crc)


def too_large(block: Block, largest: int) -> str:
    """Why a block is not unpacked, whatever it holds; '' as a rule. largest: limits().chunk."""
    if block.size > largest or block.stored > largest:
        return f"claims {block.size} bytes; chunks up to {largest} are read"
    if block.size > MAX_RATIO * max(block.stored, 64):
        return f"claims to unpack {block.stored} bytes to {block.size}"
    return ""


def unpack(file: BinaryIO, block: Block) -> bytes:
    """The records of a block, its checksum verified. Raises Damaged."""
    if why := too_large(block, int(limits().chunk)):
        raise Damaged(why)
    file.seek(block.start)
    content = _decompress(block, file.read(block.stored))
    if len(content) != block.size:
        raise Damaged(f"unpacks to {len(content)} bytes instead of {block.size}")
    if block.crc and crc32(content) != block.crc:
        raise Damaged("its checksum does not hold")
    return content


def _decompress(block: Block, data: bytes) -> bytes:
    """At most one byte more than the block claims, whatever the compressed data would give."""
    try:
        if block.compression == "zstd":
            unpacker = zstandard.ZstdDecompressor(max_window_size=MAX_WINDOW)
            with unpacker.stream_reader(data) as reader:
                return reader.read(block.size + 1)
        if block.compression == "lz4":
            return bytes(
                lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=block.size + 1)
            )
    except (zstandard.ZstdError, RuntimeError, EOFError) as error:
        # zstd also says "too much memory" of a damaged head that asks for a huge window: no want
        if "not enough memory" in str(error).lower():
            raise MemoryError(str(error)) from None
        raise Damaged(f"cannot be unpacked: {error}") from None

    if block.compression:
        raise Damaged(f"compression {block.compression!r} is not one of zstd, lz4, none")
    return data


def split(content: bytes) -> tuple[Starts, list[tuple[int, int, int]]]:
    """Where the message records begin in an unpacked block, shape (n,), and its definitions
    (opcode, start, end). Raises Damaged where the records do not tile it.
    """
    starts, definitions = [], []
    for opcode, start, end in records(content):
        if opcode == Opcode.MESSAGE and end - start >= MESSAGE_HEAD.size - RECORD_HEAD.size:
            starts.append(start - RECORD_HEAD.size)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            definitions.append((opcode, start, end))
        else:
            raise Damaged(f"holds a record of opcode 0x{opcode:02x} and {end - start} bytes")
    return np.array(starts, np.int64), definitions


def records(data: bytes, stop: int | None = None) -> Iterator[tuple[int, int, int]]:
    """(opcode, start, end) of each record body in `data`, up to `stop`. Raises Damaged where they
    do not tile it.
    """
    stop = len(data) if stop is None else stop
    position = 0

    while position < stop:
        if position + RECORD_HEAD.size > stop:
            raise Damaged("ends inside a record")
        opcode, length = RECORD_HEAD.unpack_from(data, position)
        start = position + RECORD_HEAD.size
        position = start + length
        if position > stop:
            raise Damaged("ends inside a record")
        yield opcode, start, position
