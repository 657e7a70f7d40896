"""Find what is intact in an MCAP file, closed or not, cut or damaged, ours or another writer's.

The file is walked record by record from its start; the index at its end is used for cross-checks
only. Where the walk finds no valid record it searches for the head of the next chunk. Memory and
time are bounded whatever the bytes say.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap.opcode import Opcode

from gritd.estimator.compiled import records
from gritd.estimator.limits import limits
from gritd.estimator.recording.attachments import AttachmentPlace
from gritd.estimator.recording.blocks import Block, Damaged, Room, Texts
from gritd.estimator.recording.mcapfile import MAGIC, RecordingError
from gritd.estimator.recording.message_records import RECORD_HEAD

MAX_RUN = 4 << 20  # [bytes] unchunked messages are read in runs of this size
MAX_DEFINITION = 1 << 20  # [bytes] schema, channel
MAX_METADATA = 16 << 20  # [bytes] all of it together
MAX_SUMMARY = 4 << 20  # [bytes] definitions and statistics stand at its start
MAX_IDLE = 100_000  # records without messages: attachments, metadata; writers make a few
INDEXES = 64  # message indexes of a chunk; one for each of its channels
SEARCH = 64 << 20  # [bytes] the next chunk is looked for this far

_NEXT_CHUNK = re.compile(
    rb"\x06.{4}\x00{4}.{28}(?:\x04\x00\x00\x00zstd|\x03\x00\x00\x00lz4|\x00\x00\x00\x00)", re.DOTALL
)
_FOOTER = struct.Struct("<BQQQI")
_CLOSING = _FOOTER.size + len(MAGIC)
_DATA_END_SIZE = 13
_STEP = 1 << 20
_NEAR = 1 << 17  # [bytes] some chunks of an ordinary recording
_TOGETHER = 1 << 18  # [bytes] of the file that small chunks are looked for in
_SMALL = 1 << 15  # [bytes] of larger ones the heads alone are read
_WINDOW = 1 << 13  # [bytes] of the file read at once where records are small
_INDEX = struct.Struct("<BQHI")  # opcode, length, channel, length of the entries
_LOOSE = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)


@dataclass
class Contents:
    """What a walk over the file found, but for its blocks."""

    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    repeated: list[tuple[str, dict[str, str]]] = field(default_factory=list)  # under a name again
    damage: list[str] = field(default_factory=list)
    attachments: list[AttachmentPlace] = field(default_factory=list)
    closed: bool = False  # ends with an index that is intact
    summary: bytes = b""  # the first of its records, checksum verified
    headed: bool = False  # has a header
    library: str = ""  # who wrote the file


class Walk:
    """One walk over a file's top-level records."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self.size = size
        self._limit = size  # where the data section ends
        self._metadata_room = MAX_METADATA
        self._idle = 0  # records without messages
        self._chunks, self._most = 0, limits().chunks
        # the last one, whose message index may follow, and the one before
        self._blocks: list[Block] = []
        self._room = Room()
        self._small = records.BUILT  # whether small chunks are looked for together
        self._window, self._window_start = b"", 0  # the part of the file that was read last
        self.contents = Contents()

    def begin(self) -> None:
        """Look at both ends. Raises RecordingError if this is no MCAP file at all."""
        self._check_magic()
        self._read_closing()

    def blocks(self) -> Iterator[Block]:
        """The blocks in file order; what else there is, is in `found` at the end."""
        position: int | None = len(MAGIC)
        while position is not None and position < self._limit:
            position = self._several(position) or self._step(position)
            yield from self._blocks[:-1]
            del self._blocks[:-1]
            if too_many := self._too_many():
                line = f"byte {position}: more than {too_many}; the rest is not read"
                self.contents.damage.append(line)
                break

        yield from self._blocks

    def _several(self, position: int) -> int | None:
        """The position after small chunks that lie end to end from `position` on; None where there
        are none, and from where something is not as it should be.
        """
        small = self._small and self._blocks and self._blocks[-1].stored < _SMALL
        if not small or self._read(position, 1)[0] != Opcode.CHUNK:
            return None

        size, most = min(_TOGETHER, self._limit - position), int(self._most - self._chunks) + 1
        data = self._room.read(self._file, position, size)
        found = records.chunks(data, position, most, INDEXES)
        for start, stored, size, crc, end in found:
            self._found(Block(start, stored, size, crc, "zstd", (start + stored, end)))

        self._small = bool(found)
        return found[-1][-1] if found else None

    def spread(self, count: int, after: int) -> Iterator[Block]:
        """Chunks near so many places behind `after`, evenly spread over the file, and the last
        ones. In file order.
        """
        room = max(self._limit - len(MAGIC) - _NEAR, 0)
        for number in range(1, count + 1):
            start = len(MAGIC) + number * room // count
            place = self._find_chunk(max(start, after), _NEAR, 2 * _NEAR)
            if place is not None:
                block, after = self._chunk_at(place)
                yield block

        while count and (place := self._find_chunk(after, _NEAR, 2 * _NEAR)) is not None:
            block, after = self._chunk_at(place)
            yield block

    def _chunk_at(self, place: int) -> tuple[Block, int]:
        """The chunk whose record begins there, and where what follows it begins."""
        _, length = RECORD_HEAD.unpack(self._read(place, RECORD_HEAD.size))
        start = place + RECORD_HEAD.size
        end = self._indexes(start + length)
        return self._chunk_head(start, length)._replace(indexes=(start + length, end)), end

    def _too_many(self) -> str:
        """What there is more of than a recording has; '' as a rule."""
        if self._chunks > self._most:
            return f"{self._most:.0f} chunks"
        idle = self._idle > MAX_IDLE + INDEXES * self._chunks
        return f"{MAX_IDLE} records without messages" if idle else ""

    def _read(self, start: int, size: int) -> bytes:
        size = max(0, min(size, self._limit - start))
        at = start - self._window_start
        if not 0 <= at <= len(self._window) - size:
            self._file.seek(start)
            if size >= _WINDOW:
                return self._file.read(size)
            self._window, self._window_start, at = self._file.read(_WINDOW), start, 0
        return self._window[at : at + size]

    def _check_magic(self) -> None:
        if self._read(0, len(MAGIC)) == MAGIC:
            return
        try:
            opcode, length = RECORD_HEAD.unpack(self._read(len(MAGIC), RECORD_HEAD.size))
            self._header(len(MAGIC) + RECORD_HEAD.size, length if opcode == Opcode.HEADER else 0)
        except (struct.error, Damaged):
            raise RecordingError("not an MCAP file") from None
        self.contents.damage.append("byte 0: the file's magic is damaged")

    def _read_closing(self) -> None:
        """Footer, magic and summary: trusted if the checksum holds, else the walk goes to the end
        of the file.
        """
        tail = self._read(max(0, self.size - _CLOSING), _CLOSING)
        if len(tail) < _CLOSING or not tail.endswith(MAGIC):
            return

        opcode, length, start, _, crc = _FOOTER.unpack(tail[: _FOOTER.size])
        end = self.size - _CLOSING
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

        self.contents.closed = True
        self.contents.summary = self._read(start, min(end - start, MAX_SUMMARY)) if crc else b""
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
        self._idle += opcode not in (*_LOOSE, Opcode.CHUNK)

        if opcode in _LOOSE:
            return self._loose_run(position)
        if opcode == Opcode.CHUNK:
            return self._chunk(start, length)
        if opcode == Opcode.MESSAGE_INDEX:
            self._message_index(position, start, length)
        elif opcode == Opcode.METADATA:
            self._metadata(start, length)
        elif opcode == Opcode.HEADER:
            self._header(start, length)
        elif opcode == Opcode.ATTACHMENT:
            place = AttachmentPlace(position, RECORD_HEAD.size + length)
            self.contents.attachments.append(place)
        elif opcode == Opcode.DATA_END and length == 4:
            return None
        else:
            raise Damaged(f"no record of MCAP's data section has opcode 0x{opcode:02x}")

        return start + length

    def _chunk(self, start: int, length: int) -> int:
        """The position after a chunk and its message indexes."""
        block, end = self._chunk_head(start, length), start + length
        after = self._indexes(end)
        self._found(block._replace(indexes=(end, after)) if after > end else block)
        return after

    def _indexes(self, position: int) -> int:
        """The end of the message indexes from `position` on, as far as they are whole."""
        while len(head := self._read(position, _INDEX.size)) == _INDEX.size:
            opcode, length, _, entries = _INDEX.unpack(head)
            after = position + RECORD_HEAD.size + length
            if opcode != Opcode.MESSAGE_INDEX or entries + 6 != length or after > self._limit:
                break
            self._idle += 1
            position = after
            if self._too_many():
                break

        return position

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
        if self._blocks:
            last = self._blocks[-1]
            first = last.indexes[0] if last.indexes[1] == position else position
            self._blocks[-1] = last._replace(indexes=(first, start + length))

    def _found(self, block: Block) -> None:
        self._blocks.append(block)
        self._chunks += 1

    def _metadata(self, start: int, length: int) -> None:
        self._metadata_room -= length
        if self._metadata_room < 0:
            raise Damaged(f"more than {MAX_METADATA} bytes of metadata")
        fields = Texts(self._read(start, length))
        name = fields.text()
        entries = fields.table()
        fields.finish()
        if self.contents.metadata.setdefault(name, entries) is not entries:
            self.contents.repeated.append((name, entries))

    def _header(self, start: int, length: int) -> None:
        if length > MAX_DEFINITION:
            raise Damaged(f"a header of {length} bytes")
        fields = Texts(self._read(start, length))
        fields.text()
        self.contents.library = fields.text()
        fields.finish()
        self.contents.headed = True

    def _loose_run(self, position: int) -> int:
        """Unchunked records up to another kind of record, a bad one, or MAX_RUN."""
        window = self._read(position, MAX_RUN)
        size = _run_length(window)
        if size == 0:  # one that is larger than the window
            size = RECORD_HEAD.size + RECORD_HEAD.unpack_from(window)[1]
            largest = int(limits().chunk)
            if size > largest:
                raise Damaged(f"an unchunked record larger than {largest} bytes")
        self._found(Block(position, size, size, 0, "", (0, 0)))
        return position + size

    def _skip(self, position: int, why: str) -> int | None:
        """Report what is skipped and find the next chunk. A cut inside an index costs nothing."""
        following = self._find_chunk(position + 1)
        if following is None and self._cut_in_index(position):
            return None
        lost = (following or self._limit) - position
        rest = f"; no chunk follows within {SEARCH} bytes, so" if lost > SEARCH else ","
        self.contents.damage.append(f"byte {position}: {why}{rest} {lost} bytes skipped")
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

    def _find_chunk(self, position: int, step: int = _STEP, far: int = SEARCH) -> int | None:
        for start in range(position, min(self._limit, position + far), step):
            window = self._read(start, step + 64)  # heads that begin in this step end inside it
            for match in _NEXT_CHUNK.finditer(window):
                if match.start() < step and self._plausible(start + match.start()):
                    return start + match.start()
        return None

    def _plausible(self, position: int) -> bool:
        _, length = RECORD_HEAD.unpack(self._read(position, RECORD_HEAD.size))
        try:
            self._chunk_head(position + RECORD_HEAD.size, length)
        except Damaged:
            return False
        return bool(position + RECORD_HEAD.size + length <= self._limit)


def _run_length(window: bytes) -> int:
    """How many bytes at the beginning are whole unchunked records."""
    position, room = 0, len(window)
    while position + RECORD_HEAD.size <= room:
        opcode, length = RECORD_HEAD.unpack_from(window, position)
        after = position + RECORD_HEAD.size + length
        if opcode not in _LOOSE or after > room:
            break
        position = after
    return position
