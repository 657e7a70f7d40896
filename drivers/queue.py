"""The bounded queue between the readers and the loop."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from threading import Lock
from typing import NamedTuple

from gritd.estimator.messages.readings import Reading


class QueueCounts(NamedTuple):
    """Since the start; received = processed + dropped + queued, at every moment."""

    received: int
    processed: int
    dropped: int
    queued: int


class ReadingQueue:
    """Readers put, the loop drains. When full the oldest reading is dropped: the newest says
    most.
    """

    def __init__(self, capacity: int = 16384) -> None:
        self._lock = Lock()
        self._readings: deque[Reading] = deque(maxlen=capacity)
        self._capacity = capacity
        self._received = self._processed = self._dropped = 0

    def put(self, readings: Sequence[Reading]) -> None:
        """Append readings, in order. Never blocks for longer than a drain takes."""
        with self._lock:
            overflow = len(self._readings) + len(readings) - self._capacity
            self._readings.extend(readings)
            self._received += len(readings)
            self._dropped += max(overflow, 0)

    def drain(self) -> list[Reading]:
        """All queued readings, oldest first; an empty list if there are none. Does not wait."""
        with self._lock:
            readings = list(self._readings)
            self._readings.clear()
            self._processed += len(readings)
        return readings

    def counts(self) -> QueueCounts:
        with self._lock:
            return QueueCounts(self._received, self._processed, self._dropped, len(self._readings))
