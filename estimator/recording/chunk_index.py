"""The index of a file that is being written: where its chunks are, kept small in memory until the file is closed.

A chunk every fifth of a second makes 18,000 ChunkIndex records an hour, 3 MB of them. What tells one from the record
before it are a few small numbers; those, compressed, take a tenth.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Sequence

from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex

_ROW = struct.Struct("<5QH")  # gap before, length, first log_time since the last one, span, unpacked size; channels
_CHANNEL = struct.Struct("<HQ")  # its number, length of its MessageIndex record
_MASK = (1 << 64) - 1  # differences wrap: a log_time may be anything
_HEAD = 9 + 8 + 8 + 8 + 4 + 4 + 8  # [bytes] of a chunk record before its data, without the name of the compression


class ChunkIndexes:
    """Chunks are added as they are written, and read once."""

    def __init__(self, compression: str) -> None:
        self.count = 0
        self._compression = compression
        self._packer = zlib.compressobj()
        self._packed = bytearray()
        self._end = self._time = 0  # of the chunk before

    def add(
        self, start: int, length: int, times: tuple[int, int], size: int, indexes: Sequence[tuple[int, int]]
    ) -> None:
        """A chunk record of `length` bytes at `start`, messages from times[0] to times[1] [ns], unpacked `size` bytes.

        indexes: (channel, length) of the MessageIndex records that follow it.
        """
        row = _ROW.pack(
            start - self._end, length, times[0] - self._time & _MASK, times[1] - times[0] & _MASK, size, len(indexes)
        )
        self._packed += self._packer.compress(row + b"".join(_CHANNEL.pack(*index) for index in indexes))
        self._end = start + length + sum(length for _, length in indexes)
        self._time = times[0]
        self.count += 1

    def records(self) -> bytes:
        """All ChunkIndex records, one after the other."""
        builder = RecordBuilder()
        for record in self._unpacked():
            record.write(builder)
        return bytes(builder.end())  # type: ignore[no-untyped-call]

    def _unpacked(self) -> Iterator[ChunkIndex]:
        rows = zlib.decompress(self._packed + self._packer.copy().flush())
        place = end = time = 0
        while place < len(rows):
            gap, length, later, span, size, channels = _ROW.unpack_from(rows, place)
            start, time = end + gap, time + later & _MASK
            place += _ROW.size
            end = start + length
            offsets = {}
            for channel, taken in _CHANNEL.iter_unpack(rows[place : place + channels * _CHANNEL.size]):
                offsets[channel] = end
                end += taken
            place += channels * _CHANNEL.size
            yield ChunkIndex(
                chunk_length=length,
                chunk_start_offset=start,
                compression=self._compression,
                compressed_size=length - _HEAD - len(self._compression),
                message_end_time=time + span & _MASK,
                message_index_length=end - start - length,
                message_index_offsets=offsets,
                message_start_time=time,
                uncompressed_size=size,
            )
