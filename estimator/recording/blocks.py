"""Find what is intact in an MCAP file, closed or not, cut or damaged, ours or another writer's.

The file is walked record by record from its start; the index at its end is used for cross-checks
only. Every length is held against the lengths inside its record before it is believed. Where the
walk finds no valid record it searches for the head of the next chunk. Memory and time are bounded
whatever the bytes say.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import BinaryIO

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import zstandard
from mcap.opcode import Opcode

from gritd.estimator.recording.mcapfile import (
    MAGIC,
    MESSAGE_DTYPE,
    MESSAGE_HEAD,
    RECORD_HEAD,
    RecordingError,
    Starts,
    gather,
)

MAX_CHUNK = 32 << 20  # [bytes] largest chunk that is unpacked; writers use about 1 MiB
MAX_RATIO = 1000  # a chunk that claims to unpack to more than this many times its size is a bomb
MAX_RUN = 4 << 20  # [bytes] unchunked messages are read in runs of this size
MAX_DEFINITION = 1 << 20  # [bytes] schema, channel
MAX_METADATA = 16 << 20  # [bytes] all of it together
MAX_SUMMARY = 4 << 20  # [bytes] definitions and statistics stand at its start
MAX_BLOCKS = 500_000  # a day of chunks at five a second
SEARCH = 64 << 20  # [bytes] the next chunk is looked for this far
MAX_WASTE = 128 << 20  # [bytes] read and unpacked in vain before giving up

_NEXT_CHUNK = re.compile(
    rb"\x06.{4}\x00{4}.{28}(?:\x04\x00\x00\x00zstd|\x03\x00\x00\x00lz4|\x00\x00\x00\x00)", re.DOTALL
)
_FOOTER = struct.Struct("<BQQQI")
_CLOSING = _FOOTER.size + len(MAGIC)
_DATA_END_SIZE = 13
_STEP = 1 << 20
_LOOSE = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)


class Damaged(Exception):
    """A record or a chunk that cannot be trusted; the message says why."""


@dataclass(frozen=True, slots=True)
class Block:
    """Records of messages and their definitions: a chunk, or a run of unchunked records
    (compression "", crc 0).
    """

    start: int  # of the stored bytes in the file
    stored: int  # how many they are
    size: int  # how many they are unpacked
    crc: int  # of the unpacked bytes; 0: the writer gave none
    compression: str
    index: tuple[int, int] = (
        0,
        0,
    )  # its message index in the file; under no checksum, so only a hint


@dataclass
class Contents:
    """What a walk over the file found."""

    blocks: list[Block] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)
    attachments: int = 0
    closed: bool = False  # ends with an index that is intact
    summary: bytes = b""  # the first of its records, checksum verified
    library: str = ""  # who wrote the file


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
        found: dict[str, str] = {}
        while entries.position < len(entries.data):
            key = entries.text()
            found[key] = entries.text()
        return found

    def finish(self) -> None:
        if self.position != len(self.data):
            raise Damaged("the record is longer than its fields")


class Walk:
    """One walk over a file's top-level records."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self._size = size
        self._limit = size  # where the data section ends
        self._metadata_room = MAX_METADATA
        self.found = Contents()

    def run(self) -> Contents:
        """Raises RecordingError if this is no MCAP file at all."""
        self._check_magic()
        self._read_closing()
        position: int | None = len(MAGIC)
        while position is not None and position < self._limit:
            position = self._step(position)
            if len(self.found.blocks) > MAX_BLOCKS:
                self.found.damage.append(
                    f"byte {position}: more than {MAX_BLOCKS} chunks; the rest is not read"
                )
                break
        return self.found

    def _read(self, start: int, size: int) -> bytes:
        self._file.seek(start)
        return self._file.read(max(0, min(size, self._limit - start)))

    def _check_magic(self) -> None:
        if self._read(0, len(MAGIC)) == MAGIC:
            return
        try:
            opcode, length = RECORD_HEAD.unpack(self._read(len(MAGIC), RECORD_HEAD.size))
            self._header(len(MAGIC) + RECORD_HEAD.size, length if opcode == Opcode.HEADER else 0)
        except (struct.error, Damaged):
            raise RecordingError("not an MCAP file") from None
        self.found.damage.append("byte 0: the file's magic is damaged")

    def _read_closing(self) -> None:
        """Footer, magic and summary: trusted if the checksum holds, else the walk goes to the end
        of the file.
        """
        tail = self._read(max(0, self._size - _CLOSING), _CLOSING)
        if len(tail) < _CLOSING or not tail.endswith(MAGIC):
            return
        opcode, length, start, _, crc = _FOOTER.unpack(tail[: _FOOTER.size])
        end = self._size - _CLOSING
        if (
            opcode != Opcode.FOOTER
            or length != 20
            or not (start == 0 or _DATA_END_SIZE <= start <= end)
        ):
            return
        self._take_summary(start or end, end, crc, tail)

    def _take_summary(self, start: int, end: int, crc: int, tail: bytes) -> None:
        data_end = self._read(start - _DATA_END_SIZE, 9)
        if data_end != RECORD_HEAD.pack(Opcode.DATA_END, 4):
            return
        running = 0
        for position in range(start, end, _STEP):
            running = zlib.crc32(self._read(position, min(_STEP, end - position)), running)
        if crc and zlib.crc32(tail[: _FOOTER.size - 4], running) != crc:
            return
        self.found.closed = True
        self.found.summary = self._read(start, min(end - start, MAX_SUMMARY)) if crc else b""
        self._limit = start - _DATA_END_SIZE

    def _step(self, position: int) -> int | None:
        """The position after the record at `position`, or after what had to be skipped; None at the
        end.
        """
        head = self._read(position, RECORD_HEAD.size)
        try:
            if len(head) < RECORD_HEAD.size:
                raise Damaged("the data ends inside a record")
            opcode, length = RECORD_HEAD.unpack(head)
            if position + RECORD_HEAD.size + length > self._limit:
                raise Damaged(f"the data ends inside a record of {length} bytes")
            return self._record(opcode, position, length)
        except Damaged as why:
            return self._skip(position, str(why))

    def _record(self, opcode: int, position: int, length: int) -> int | None:
        start = position + RECORD_HEAD.size
        if opcode in _LOOSE:
            return self._loose_run(position)
        if opcode == Opcode.CHUNK:
            self._chunk(start, length)
        elif opcode == Opcode.MESSAGE_INDEX:
            self._message_index(position, start, length)
        elif opcode == Opcode.METADATA:
            self._metadata(start, length)
        elif opcode == Opcode.HEADER:
            self._header(start, length)
        elif opcode == Opcode.ATTACHMENT:
            self.found.attachments += 1
        elif opcode == Opcode.DATA_END and length == 4:
            return None
        else:
            raise Damaged(f"no record of MCAP's data section has opcode 0x{opcode:02x}")
        return start + length

    def _chunk(self, start: int, length: int) -> None:
        self.found.blocks.append(self._chunk_head(start, length))

    def _chunk_head(self, start: int, length: int) -> Block:
        fields = Texts(self._read(start, min(length, 64)))
        fields.take(16)  # first and last log_time
        size, crc, compression, stored = (
            fields.integer(8),
            fields.integer(4),
            fields.text(),
            fields.integer(8),
        )
        if fields.position + stored != length:
            raise Damaged("the lengths of a chunk contradict each other")
        return Block(start + fields.position, stored, size, crc, compression)

    def _message_index(self, position: int, start: int, length: int) -> None:
        fields = Texts(self._read(start, 6))
        fields.take(2)
        if fields.integer(4) + 6 != length:
            raise Damaged("the lengths of a message index contradict each other")
        if self.found.blocks:
            last = self.found.blocks[-1]
            first = last.index[0] if last.index[1] == position else position
            self.found.blocks[-1] = replace(last, index=(first, start + length))

    def _metadata(self, start: int, length: int) -> None:
        self._metadata_room -= length
        if self._metadata_room < 0:
            raise Damaged(f"more than {MAX_METADATA} bytes of metadata")
        fields = Texts(self._read(start, length))
        name = fields.text()
        entries = fields.table()
        fields.finish()
        self.found.metadata.setdefault(name, entries)

    def _header(self, start: int, length: int) -> None:
        if length > MAX_DEFINITION:
            raise Damaged(f"a header of {length} bytes")
        fields = Texts(self._read(start, length))
        fields.text()
        self.found.library = fields.text()
        fields.finish()

    def _loose_run(self, position: int) -> int:
        """Unchunked records up to another kind of record, a bad one, or MAX_RUN."""
        end = position
        while end - position < MAX_RUN:
            head = self._read(end, RECORD_HEAD.size)
            if len(head) < RECORD_HEAD.size or head[0] not in _LOOSE:
                break
            after = end + RECORD_HEAD.size + RECORD_HEAD.unpack(head)[1]
            if after > self._limit or after - position > MAX_CHUNK:
                break
            end = after
        if end == position:
            raise Damaged(f"an unchunked record larger than {MAX_CHUNK} bytes")
        self.found.blocks.append(Block(position, end - position, end - position, 0, "", (0, 0)))
        return end

    def _skip(self, position: int, why: str) -> int | None:
        """Report what is skipped and find the next chunk. A cut inside an index costs nothing."""
        following = self._find_chunk(position + 1)
        if following is None and self._cut_in_index(position):
            return None
        lost = (following or self._limit) - position
        rest = f"; no chunk follows within {SEARCH} bytes, so" if lost > SEARCH else ","
        self.found.damage.append(f"byte {position}: {why}{rest} {lost} bytes skipped")
        return following

    def _cut_in_index(self, position: int) -> bool:
        """Whether the file ends inside a record that holds no messages."""
        head = self._read(position, 15)
        if head[0] == Opcode.DATA_END:
            return self._limit - position <= _DATA_END_SIZE
        whole = len(head) == 15
        agree = (
            not whole
            or int.from_bytes(head[1:9], "little") == int.from_bytes(head[11:15], "little") + 6
        )
        return head[0] == Opcode.MESSAGE_INDEX and agree

    def _find_chunk(self, position: int) -> int | None:
        for start in range(position, min(self._limit, position + SEARCH), _STEP):
            window = self._read(
                start, _STEP + 64
            )  # heads that begin in this step end inside the window
            for match in _NEXT_CHUNK.finditer(window):
                if match.start() < _STEP and self._plausible(start + match.start()):
                    return start + match.start()
        return None

    def _plausible(self, position: int) -> bool:
        _, length = RECORD_HEAD.unpack(self._read(position, RECORD_HEAD.size))
        try:
            self._chunk_head(position + RECORD_HEAD.size, length)
        except Damaged:
            return False
        return bool(position + RECORD_HEAD.size + length <= self._limit)


def unpack(file: BinaryIO, block: Block) -> bytes:
    """The records of a block, its checksum verified. Raises Damaged."""
    if block.size > MAX_CHUNK or block.stored > MAX_CHUNK:
        raise Damaged(f"claims {block.size} bytes; chunks up to {MAX_CHUNK} are read")
    if block.size > MAX_RATIO * max(block.stored, 64):
        raise Damaged(f"claims to unpack {block.stored} bytes to {block.size}")
    file.seek(block.start)
    content = _decompress(block, file.read(block.stored))
    if len(content) != block.size:
        raise Damaged(f"unpacks to {len(content)} bytes instead of {block.size}")
    if block.crc and zlib.crc32(content) != block.crc:
        raise Damaged("its checksum does not hold")
    return content


def _decompress(block: Block, data: bytes) -> bytes:
    """At most one byte more than the block claims, whatever the compressed data would give."""
    try:
        if block.compression == "zstd":
            with zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK * 2).stream_reader(
                data
            ) as reader:
                return reader.read(block.size + 1)
        if block.compression == "lz4":
            return bytes(
                lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=block.size + 1)
            )
    except (zstandard.ZstdError, RuntimeError, EOFError) as error:
        raise Damaged(f"cannot be unpacked: {error}") from None
    if block.compression:
        raise Damaged(f"compression {block.compression!r} is not one of zstd, lz4, none")
    return data


def split(
    file: BinaryIO, block: Block, content: bytes
) -> tuple[Starts, list[tuple[int, int, int]]]:
    """Where the message records begin in an unpacked block, shape (n,), and its definitions
    (opcode, start, end).

    The message index saves walking the records, but only if the messages it names are proven to lie
    end to end from the last definition to the end of the block. Raises Damaged where the records do
    not tile it.
    """
    hint = _indexed(file, block)
    if hint.size and _tile(content, hint):
        before = list(records(content, int(hint[0])))
        if all(opcode in (Opcode.SCHEMA, Opcode.CHANNEL) for opcode, _, _ in before):
            return hint, before
    return _walked(content)


def _walked(content: bytes) -> tuple[Starts, list[tuple[int, int, int]]]:
    starts, definitions = [], []
    for opcode, start, end in records(content):
        if opcode == Opcode.MESSAGE and end - start >= MESSAGE_HEAD.size - RECORD_HEAD.size:
            starts.append(start - RECORD_HEAD.size)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            definitions.append((opcode, start, end))
        else:
            raise Damaged(f"holds a record of opcode 0x{opcode:02x} and {end - start} bytes")
    return np.array(starts, np.int64), definitions


def _tile(content: bytes, starts: Starts) -> bool:
    """Whether messages, and nothing else, lie end to end from the first of these to the end."""
    if starts[0] < 0 or starts[-1] + MESSAGE_HEAD.size > len(content):
        return False
    heads = gather(content, starts, MESSAGE_DTYPE)
    ends = starts + RECORD_HEAD.size + heads["length"].astype(np.int64)
    long_enough = heads["length"] >= MESSAGE_HEAD.size - RECORD_HEAD.size
    return bool(
        np.all(heads["opcode"] == Opcode.MESSAGE)
        and np.all(long_enough)
        and np.array_equal(ends[:-1], starts[1:])
        and ends[-1] == len(content)
    )


def _indexed(file: BinaryIO, block: Block) -> Starts:
    """Where the message index says that messages begin, sorted. Empty if there is none."""
    first, end = block.index
    if not 0 < end - first <= MAX_CHUNK:
        return np.empty(0, np.int64)
    file.seek(first)
    data = file.read(end - first)
    found = []
    for _, start, stop in records(data):
        found.append(np.frombuffer(data, "<u8", (stop - start - 6) // 8, start + 6)[1::2])
    return np.sort(
        np.concatenate(found).astype(np.int64)
    )  # one that is too large becomes negative, and stands first


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
