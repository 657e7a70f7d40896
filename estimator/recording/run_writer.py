"""The writer of one run's file.

File order is the order of the calls, and replay relies on it: the readings a tick consumed stand
before that tick. See docs/recording.md.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.messages.tick import REVISION
from gritd.estimator.recording.bulk import Bytes, Stamps, merged, records
from gritd.estimator.recording.cdr import ENCAPSULATION, Topic, Values
from gritd.estimator.recording.mcapfile import McapFile, RecordingError
from gritd.estimator.recording.message_records import MESSAGE_HEAD, RECORD_HEAD
from gritd.estimator.recording.metadata import CONFIG, RUN, TICK_REVISION, sealed, versions
from gritd.estimator.recording.topics import LOG_TOPIC, RAW_TOPICS

CHUNK_SIZE = 1 << 20  # [bytes] a chunk is closed at this size even if nobody flushes


class RunWriter:
    """One recording, written synchronously in the order of the calls.

    `topics` come in addition to the raw topics and /log. The path must not exist yet. Messages
    gather in memory until `flush`, or until a chunk is full. After an error the messages not yet
    written are kept, and `flush` may be called again.

    mode: the file's permissions; None leaves them to the umask.

    Raises RecordingError where the file cannot be created or written, ValueError where a message
    does not fit its topic.
    """

    def __init__(
        self,
        path: Path | str,
        topics: Iterable[Topic],
        config_yaml: str,
        run: RunInfo,
        *,
        compression: str = "zstd",
        chunk_size: int = CHUNK_SIZE,
        mode: int | None = None,
    ) -> None:
        self.path = Path(path)
        self._chunk_size = chunk_size
        self._pending = _Pending()
        self._file = McapFile(self.path, compression, mode=mode)
        self._encoders = _define(self._file, (*RAW_TOPICS, LOG_TOPIC, *topics))

        with self._file.beginning():
            computed = {**versions(), TICK_REVISION: str(REVISION)}
            self._file.add_metadata(CONFIG, sealed(CONFIG, {"yaml": config_yaml, **computed}))
            self._file.add_metadata(RUN, sealed(RUN, run.entries()))

    def reading(self, reading: Reading) -> None:
        """One raw reading, under its receive time."""
        value = reading.value
        values = (reading.stamp, *value) if isinstance(value, tuple) else (reading.stamp, value)
        self.message("/raw/" + reading.channel, reading.received, values)

    def readings(self, streams: Sequence[tuple[str, Stamps, NDArray[np.generic]]]) -> None:
        """Many raw readings, received when they were taken: channel, stamps (n,) [ns] that rise,
        values (n,) or (n, fields). They stand in the order of the stamps, then of the streams, as
        `reading` one by one would write them.
        """
        encoders = [self._encoders["/raw/" + channel] for channel, _, _ in streams]
        if not streams:
            return
        each = [
            encoder.many(stamps, values)
            for encoder, (_, stamps, values) in zip(encoders, streams, strict=True)
        ]
        whole, ends = merged(each, [stamps for _, stamps, _ in streams])

        done = begin = 0
        while done < ends.size:
            room = self._chunk_size - len(self._pending.records)
            until = min(int(np.searchsorted(ends, begin + room)) + 1, ends.size)
            starts = np.concatenate(([begin], ends[done : until - 1])) - begin
            self._pending.extend(whole[begin : ends[until - 1]].tobytes(), starts)
            done, begin = until, int(ends[until - 1])
            if self._is_full():
                self.write_out()

    def message(self, topic: str, log_time: int, values: Values) -> None:
        """One message; `values` in the order of the topic's fields, `log_time` in ns."""
        try:
            self._pending.add(self._encoders[topic](log_time, values))
        except KeyError:
            raise ValueError(f"{topic}: not a topic of this recording") from None
        except (struct.error, TypeError) as error:
            raise ValueError(
                f"{topic}: {tuple(values)!r:.200} does not fit its fields: {error}"
            ) from None

        if self._is_full():
            self.write_out()

    def _is_full(self) -> bool:
        try:
            return len(self._pending.records) >= self._chunk_size
        except MemoryError:  # the message was taken, and must not look as if it had not been
            return False

    def write_out(self) -> None:
        """Close the chunk and hand it to the kernel: from here on it survives the death of this
        process.
        """
        if self._pending.starts:
            # made before: once the chunk is written, nothing may fail
            following = _Pending()
            self._file.add_chunk(self._pending.records, np.array(self._pending.starts, np.int64))
            self._pending = following

    def flush(self) -> None:
        """`write_out`, and wait until the medium has it: from here on it survives the loss of
        power.
        """
        self.write_out()
        self._file.sync()

    def close(self) -> None:
        """Write what is pending, the index and the summary. The file is closed even if that
        fails.
        """
        try:
            self.write_out()
        except RecordingError:
            self._file.abandon()
            raise
        self._file.close()

    def finish(self, sync: Callable[[int], None]) -> None:
        """`close`, but the wait for the medium is left to `sync`, which is given the descriptor
        and may keep a copy.
        """
        try:
            self.write_out()
            self._file.finish()
            sync(self._file.fileno())
        finally:
            self._file.abandon()

    def abandon(self) -> None:
        """Close the file as it is, without an index. Nothing already written is lost."""
        self._file.abandon()

    def expect(self, size: int) -> None:
        """Prepare for chunks of up to so many bytes."""
        self._file.expect(size)

    def adopt(self, other: RunWriter) -> None:
        """Take over what `other` could not write, and its numbering; both must have been made
        with the same topics and the same compression.
        """
        self._pending, other._pending = other._pending, self._pending
        self._encoders = other._encoders
        self._file.adopt(other._file)

    def fileno(self) -> int:
        return self._file.fileno()


class _Pending:
    """Message records of the chunk being filled, and where each begins."""

    def __init__(self) -> None:
        self.records = bytearray()
        self.starts = array("q")

    def add(self, record: bytes) -> None:
        """Raises MemoryError, and nothing has changed."""
        self.starts.append(len(self.records))
        try:
            self.records += record
        except MemoryError:
            self.starts.pop()
            raise

    def extend(self, records: bytes, starts: Stamps) -> None:
        """The same of several, which begin at `starts` (n,) in `records`."""
        before = len(self.starts)
        self.starts.frombytes((starts + len(self.records)).tobytes())
        try:
            self.records += records
        except MemoryError:
            del self.starts[before:]
            raise


class _Encoder:
    """Message records of one channel: MCAP's head and the CDR body, packed in one call where the
    topic is flat.
    """

    def __init__(self, channel: int, topic: Topic) -> None:
        self._channel = channel
        self._topic, self._codec = topic, topic.codec
        self._sequence = 0
        self._length = MESSAGE_HEAD.size - RECORD_HEAD.size + self._codec.size
        self._pack = struct.Struct(MESSAGE_HEAD.format + self._codec.format).pack

    def __call__(self, log_time: int, values: Values) -> bytes:
        number = (self._sequence + 1) & 0xFFFFFFFF
        record = self._record(number, log_time, values)
        self._sequence = number  # only now: a message that does not fit leaves no gap
        return record

    def many(self, stamps: Stamps, values: NDArray[np.generic]) -> Bytes:
        """Records (n, size) of a flat topic. Raises ValueError where they do not fit."""
        made = records(self._topic, self._channel, self._sequence + 1, stamps, values)
        self._sequence = (self._sequence + stamps.size) & 0xFFFFFFFF
        return made

    def _record(self, number: int, log_time: int, values: Values) -> bytes:
        if self._codec.flat:
            flat = self._codec.flatten(values)
            return self._pack(
                Opcode.MESSAGE,
                self._length,
                self._channel,
                number,
                log_time,
                log_time,
                ENCAPSULATION,
                *flat,
            )

        body = self._codec.encode(values)
        length = MESSAGE_HEAD.size - RECORD_HEAD.size + len(body)

        return (
            MESSAGE_HEAD.pack(Opcode.MESSAGE, length, self._channel, number, log_time, log_time)
            + body
        )


def _define(file: McapFile, topics: Iterable[Topic]) -> dict[str, _Encoder]:
    """Schemas and channels of the topics, numbered in their order. Raises ValueError where two
    disagree on a schema.
    """
    schemas: dict[str, Schema] = {}
    encoders: dict[str, _Encoder] = {}
    for number, topic in enumerate(topics, start=1):
        new = Schema(
            id=len(schemas) + 1,
            name=topic.schema_name,
            encoding="ros2msg",
            data=topic.schema.encode(),
        )
        schema = schemas.setdefault(topic.schema_name, new)
        if schema.data != new.data or topic.name in encoders:
            raise ValueError(
                f"{topic.name}: defined twice, or its schema {topic.schema_name} is, differently"
            )
        file.define(schema, Channel(number, topic.name, "cdr", {}, schema.id))
        encoders[topic.name] = _Encoder(number, topic)

    return encoders
