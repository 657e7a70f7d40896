"""The index of a file that is being written: where its chunks are, kept small in memory until the
file is closed.

A chunk every fifth of a second makes 18,000 ChunkIndex records an hour, 3 MB of them. What tells
one from the record before it are a few small numbers; those, compressed, take a tenth.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Sequence

from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex

from gritd.estimator.compiled.arithmetic import integer_sum

# gap before, length, first log_time since the last one, span, unpacked size; channels
_ROW = struct.Struct("<5QH")
_CHANNEL = struct.Struct("<HQ")  # its number, length of its MessageIndex record
TOGETHER = 100  # records
PIECE = 1024  # [bytes] unpacked at once
_MASK = (1 << 64) - 1  # differences wrap: a log_time may be anything
# [bytes] of a chunk record before its data, without the name of the compression
_HEAD = 9 + 8 + 8 + 8 + 4 + 4 + 8


class ChunkIndexes:
    """Chunks are added as they are written, and read once."""

    def __init__(self, compression: str) -> None:
        self.count = 0
        self._compression = compression
        self._packer = zlib.compressobj()
        self._packed = bytearray()
        self._end = self._time = 0  # of the chunk before

    def add(
        self,
        start: int,
        length: int,
        times: tuple[int, int],
        size: int,
        indexes: Sequence[tuple[int, int]],
    ) -> None:
        """A chunk record of `length` bytes at `start`, messages from times[0] to times[1] [ns],
        unpacked `size` bytes.

        indexes: (channel, length) of the MessageIndex records that follow it.
        """
        row = _ROW.pack(
            start - self._end,
            length,
            times[0] - self._time & _MASK,
            times[1] - times[0] & _MASK,
            size,
            len(indexes),
        )

        self._packed += self._packer.compress(
            row + b"".join(_CHANNEL.pack(*index) for index in indexes)
        )

        self._end = start + length + integer_sum(length for _, length in indexes)
        self._time = times[0]
        self.count += 1

    def records(self) -> Iterator[bytes]:
        """All ChunkIndex records in their order, some at a time: together they are megabytes."""
        builder = RecordBuilder()
        for number, record in enumerate(self._unpacked(), start=1):
            record.write(builder)
            if number % TOGETHER == 0:
                yield bytes(builder.end())  # type: ignore[no-untyped-call]
        yield bytes(builder.end())  # type: ignore[no-untyped-call]

    def _unpacked(self) -> Iterator[ChunkIndex]:
        end = time = 0
        for (gap, length, later, span, size, _), indexes in self._rows():
            start, time = end + gap, time + later & _MASK
            end = start + length

            offsets = {}
            for channel, taken in indexes:
                offsets[channel] = end
                end += taken

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

    def _rows(self) -> Iterator[tuple[tuple[int, ...], list[tuple[int, int]]]]:
        """What `add` packed: the row and its channels."""
        unpack, rows = zlib.decompressobj(), bytearray()
        packed = self._packed + self._packer.copy().flush()

        for start in range(0, len(packed), PIECE):
            rows += unpack.decompress(packed[start : start + PIECE])
            while len(rows) >= _ROW.size:
                row = _ROW.unpack_from(rows)
                end = _ROW.size + row[-1] * _CHANNEL.size
                if len(rows) < end:
                    break
                yield row, list(_CHANNEL.iter_unpack(rows[_ROW.size : end]))
                del rows[:end]
