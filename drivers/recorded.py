"""Recorded input in the place of hardware: the chunks of a wire log, or readings of an earlier run.

Paced in real time, an item is due as long after the first one as it was when recorded. Unpaced,
everything comes at once and keeps its recorded times, so that a test of an hour takes seconds.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from typing import Protocol, TypeVar

from gritd.drivers.decoder import Decoder
from gritd.drivers.link import POLL, Chunk
from gritd.drivers.queue import ReadingQueue
from gritd.estimator.messages.readings import NS, Reading


class Received(Protocol):
    """A chunk or a reading."""

    @property
    def received(self) -> int: ...


Item = TypeVar("Item", bound=Received)


def paced(items: Iterable[Item], sleep: Callable[[float], None] = time.sleep) -> Iterator[Item]:
    """The items, each when it is due, by the monotonic clock."""
    start: tuple[int, int] | None = None
    for item in items:
        start = start or (time.monotonic_ns(), item.received)
        wait = (item.received - start[1]) - (time.monotonic_ns() - start[0])
        if wait > 0:
            sleep(wait / NS)
        yield item


def decoded(chunks: Iterable[Chunk], decoder: Decoder) -> Iterator[Reading]:
    """The readings of recorded chunks, through the path a live device takes."""
    for chunk in chunks:
        yield from decoder.decode(chunk.received, chunk.data)


def play(readings: Iterable[Reading], queue: ReadingQueue) -> None:
    """Put recorded readings into the queue, one by one."""
    for reading in readings:
        queue.put([reading])


class RecordedLink:
    """A link whose hardware is a list of chunks; EOFError at its end stops the reader."""

    def __init__(self, chunks: Iterable[Chunk], real_time: bool = False) -> None:
        self.damaged = 0
        self._chunks = chunks
        self._real_time = real_time
        self._source: Iterator[Chunk] = iter(())
        self._due: Chunk | None = None
        self._start = (0, 0)

    def open(self) -> None:
        """Back to the first chunk."""
        self._source = iter(self._chunks)
        self._due = next(self._source, None)
        self._start = (time.monotonic_ns(), self._due.received if self._due else 0)

    def read(self) -> Chunk | None:
        if self._due is None:
            raise EOFError
        if self._real_time and not self._wait(self._due):
            return None
        chunk, self._due = self._due, next(self._source, None)
        return chunk

    def _wait(self, chunk: Chunk) -> bool:
        """Wait for the chunk, at most POLL; whether it is due."""
        left = (chunk.received - self._start[1]) - (time.monotonic_ns() - self._start[0])
        if left > 0:
            time.sleep(min(left / NS, POLL))
        return left <= POLL * NS

    def close(self) -> None:
        self._source = iter(())
