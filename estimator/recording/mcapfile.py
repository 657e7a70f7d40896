"""An MCAP file written chunk by chunk (mcap.dev/spec), each chunk readable without any other part
of the file.

The mcap library's own Writer puts schemas and channels into the first chunk only, so one damaged
block can take the whole of an unclosed file with it. Here every chunk repeats the definitions it
needs, under its checksum; the library's record classes write everything that is not a message.
"""

from __future__ import annotations

import errno
import os
import random
import stat
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from io import FileIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Channel,
    Chunk,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from gritd.estimator.recording.chunk_index import ChunkIndexes
from gritd.estimator.recording.message_records import (
    MESSAGE_DTYPE,
    Starts,
    gather,
    message_index,
)
from gritd.estimator.recording.packing import compressor

MAGIC = b"\x89MCAP0\r\n"
PROFILE = "ros2"
LIBRARY = "gritd"
DRAFT = ".new"  # ends the name of a file that is being begun
Definition = tuple[Schema | None, Channel]


class RecordingError(Exception):
    """A recording cannot be written or read; the message is one line. `errno` is the system's,
    where it was asked.
    """

    def __init__(self, message: str, number: int | None = None) -> None:
        super().__init__(message)
        self.errno = number


@contextmanager
def reported(path: Path, doing: str) -> Iterator[None]:
    """Turn an OSError into one line naming the file."""
    try:
        yield
    except OSError as error:
        raise RecordingError(
            f"{path}: cannot {doing}: {error.strerror or error}", error.errno
        ) from error


def opened(path: Path, buffering: int = 1 << 18) -> BinaryIO:
    """A file to read. A pipe or a device is refused without waiting for it. Raises OSError.

    buffering [bytes]: 0 for whoever asks for large pieces here and there.
    """
    file = open(  # noqa: SIM115 - for the caller to close
        path,
        "rb",
        buffering,
        opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK),
    )

    if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        return file
    file.close()
    raise OSError(errno.EINVAL, "it is no regular file")


def sync(fileno: int) -> None:
    """fdatasync, where the file system knows it."""
    try:
        os.fdatasync(fileno)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP):
            raise


def record_bytes(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


class McapFile:
    """The file on disk: a valid prefix at every moment, an index once closed.

    A write that fails takes back what it wrote in part, so the file ends at its last whole record
    and the same call can be made again. Raises RecordingError.

    mode: the file's permissions; None leaves them to the umask.
    """

    def __init__(
        self,
        path: Path,
        compression: str = "zstd",
        library: str = LIBRARY,
        mode: int | None = None,
    ) -> None:
        if compression not in ("zstd", "lz4", "none"):
            raise RecordingError(
                f"{path}: compression {compression!r} is not one of zstd, lz4, none"
            )

        self.path = path
        self._compression = "" if compression == "none" else compression
        self._compress = compressor(compression)
        self._definitions: dict[int, Definition] = {}
        self._preambles: dict[int, bytes] = {}
        self._metadata_index: list[MetadataIndex] = []
        self._attachment_index: list[AttachmentIndex] = []
        self._chunk_indexes = ChunkIndexes(self._compression)
        self._counts: Counter[int] = Counter()
        self._indexed = True  # whether the index knows every chunk
        self._whole = True  # whether the file ends with its last whole record
        self._span: tuple[int, int] | None = None  # first and last log_time [ns]
        self._length = 0
        self._crc = 0
        self._draft = path.with_name(f".{path.name}{DRAFT}")

        with reported(path, "create"):
            if os.path.lexists(path):
                raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST))
            self._file = _created(self._draft)
            if mode is not None:
                os.fchmod(self._file.fileno(), mode)

        with self._discarding():
            self._append(MAGIC + record_bytes(Header(PROFILE, library)))

    @contextmanager
    def beginning(self) -> Iterator[None]:
        """What has to stand in the file before anybody may find it: it gets its name then, and none
        if that fails.
        """
        with self._discarding():
            yield
            with reported(self.path, "create"):
                self._draft.rename(self.path)

    @contextmanager
    def _discarding(self) -> Iterator[None]:
        try:
            yield
        except BaseException:  # Ctrl-C too
            self.abandon()
            self._draft.unlink(missing_ok=True)
            raise

    def fileno(self) -> int:
        return self._file.fileno()

    def expect(self, size: int) -> None:
        """Let the compressor take now what chunks of up to so many bytes ask of it, not by and by
        for hours.
        """
        self._compress(random.Random(size).randbytes(size))

    def adopt(self, other: McapFile) -> None:
        """Take over the compressor of a file that is about to be closed: its half megabyte stays
        where it is.
        """
        self._compress = other._compress

    def define(self, schema: Schema | None, channel: Channel) -> None:
        """Make a channel known; its definition is written into every chunk that uses it."""
        self._definitions[channel.id] = (schema, channel)
        self._preambles[channel.id] = record_bytes(*([schema] if schema else []), channel)

    def add_metadata(self, name: str, entries: Mapping[str, str]) -> None:
        data = record_bytes(Metadata(name=name, metadata=dict(entries)))
        index = MetadataIndex(offset=self._length, length=len(data), name=name)
        self._append(data)
        self._metadata_index.append(index)

    def add_attachment(self, index: AttachmentIndex, pieces: Iterable[bytes]) -> None:
        """An attachment's record as another file holds it, with what that file's index says."""
        moved = replace(index, offset=self._length)
        for piece in pieces:
            self._append(piece)
        self._attachment_index.append(moved)

    def add_chunk(self, messages: bytes | bytearray, starts: Starts) -> None:
        """Write message records, concatenated in `messages`, that begin at byte offsets `starts`,
        shape (n,), in this order, as one chunk. Raises RecordingError where the file cannot be
        written, and MemoryError.
        """
        if starts.size == 0:
            return

        heads = gather(messages, starts, MESSAGE_DTYPE)
        # np.unique would sort them
        each = np.bincount(heads["channel"])
        channels = np.flatnonzero(each).tolist()
        preamble = b"".join(self._preambles[channel] for channel in channels)
        content = preamble + messages
        offsets = starts + len(preamble)
        span = int(heads["log_time"].min()), int(heads["log_time"].max())
        chunk = record_bytes(self._chunk(content, span))
        indexes = [message_index(channel, heads, offsets) for channel in channels]
        lengths = [(channel, len(index)) for channel, index in indexes]
        counts = self._counts + Counter({channel: int(each[channel]) for channel in channels})
        whole = self._span or span
        whole = min(whole[0], span[0]), max(whole[1], span[1])

        before = self._length, self._crc
        self._append(chunk + b"".join(index for _, index in indexes))
        try:
            self._chunk_indexes.add(before[0], len(chunk), span, len(content), lengths)
        except MemoryError:
            # as if it had not been written: who wrote it tries again, in another file
            self._indexed = False
            self._length, self._crc = before
            self._rewind()
            raise
        self._counts, self._span = counts, whole

    def sync(self) -> None:
        """Ask the kernel to put everything written on the medium, and wait for it."""
        with reported(self.path, "sync"):
            sync(self._file.fileno())

    def close(self) -> None:
        """Write index and summary and close. Whatever fails, the file is closed and stays a valid
        prefix.
        """
        try:
            self.finish()
            self.sync()
        finally:
            self._file.close()

    def finish(self) -> None:
        """Write index and summary; nothing may be added then. The medium may not have them yet."""
        if not self._indexed:
            raise RecordingError(f"{self.path}: without an index, since memory was short")

        before = self._length, self._crc
        try:
            for piece in self._ending():
                self._append(piece)
        except RecordingError:
            self._length, self._crc = before
            self._rewind()
            raise

    def abandon(self) -> None:
        """Close without an index; what was written stays readable."""
        with suppress(OSError):
            self._file.close()

    def _append(self, data: bytes) -> None:
        # before anything is written: memory may be short
        view, length = memoryview(data), self._length + len(data)
        crc = zlib.crc32(data, self._crc)

        try:
            with reported(self.path, "write"):
                if not self._whole:
                    self._take_back()
                while view:
                    view = view[self._file.write(view) :]
        except (RecordingError, MemoryError):
            self._rewind()
            raise

        self._length, self._crc = length, crc

    def _rewind(self) -> None:
        """Take back what was written of a record; where that fails too, before the next one."""
        self._whole = False
        with suppress(OSError):
            self._take_back()

    def _take_back(self) -> None:
        self._file.truncate(self._length)
        self._file.seek(self._length)
        self._whole = True

    def _chunk(self, content: bytes, span: tuple[int, int]) -> Chunk:
        return Chunk(
            compression=self._compression,
            data=self._compress(content),
            message_start_time=span[0],
            message_end_time=span[1],
            uncompressed_crc=zlib.crc32(content),
            uncompressed_size=len(content),
        )

    def _ending(self) -> Iterator[bytes]:
        """What comes after the last chunk, in pieces: whole, an index of hours would leave its mark
        on the memory.
        """
        data_end = record_bytes(DataEnd(self._crc))
        start = place = self._length + len(data_end)
        crc, offsets = 0, b""
        yield data_end

        for opcode, group in self._summary_groups():
            began = place
            for piece in group:
                yield piece
                crc, place = zlib.crc32(piece, crc), place + len(piece)
            if place > began:
                offsets += record_bytes(SummaryOffset(opcode, began, place - began))

        footer = Footer(summary_start=start, summary_offset_start=place, summary_crc=0)
        crc = zlib.crc32(offsets + record_bytes(footer)[:-4], crc)
        yield offsets + record_bytes(Footer(start, place, crc)) + MAGIC

    def _summary_groups(self) -> list[tuple[Opcode, Iterable[bytes]]]:
        used = [self._definitions[channel] for channel in sorted(self._counts)]
        schemas = {schema.id: schema for schema, _ in used if schema}
        return [
            (Opcode.SCHEMA, [record_bytes(*schemas.values())]),
            (Opcode.CHANNEL, [record_bytes(*(channel for _, channel in used))]),
            (Opcode.STATISTICS, [record_bytes(self._statistics(len(schemas)))]),
            (Opcode.CHUNK_INDEX, self._chunk_indexes.records()),
            (Opcode.ATTACHMENT_INDEX, [record_bytes(*self._attachment_index)]),
            (Opcode.METADATA_INDEX, [record_bytes(*self._metadata_index)]),
        ]

    def _statistics(self, schemas: int) -> Statistics:
        first, last = self._span or (0, 0)

        return Statistics(
            attachment_count=len(self._attachment_index),
            channel_count=len(self._counts),
            channel_message_counts=dict(sorted(self._counts.items())),
            chunk_count=self._chunk_indexes.count,
            message_count=self._counts.total(),
            message_end_time=last,
            message_start_time=first,
            metadata_count=len(self._metadata_index),
            schema_count=schemas,
        )


def _created(draft: Path) -> FileIO:
    """A new file, in place of one that was begun and left. Raises OSError where the name leads to
    something else: a link, a pipe, a folder.
    """
    if os.path.lexists(draft):
        if not stat.S_ISREG(draft.lstat().st_mode):
            raise OSError(errno.EEXIST, f"{draft.name} is there and is no regular file")
        draft.unlink()
    return open(draft, "xb", buffering=0)
