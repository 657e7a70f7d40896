"""Messages on their way from the loop to the disk: a bounded queue that counts every one."""

from __future__ import annotations

import threading
from collections import deque
from itertools import islice
from typing import NamedTuple

from gritd.estimator.messages.readings import Reading
from gritd.estimator.recording.cdr import Values

BATCH = 5_000  # messages taken at once, so that a chunk stays small after an outage

Message = tuple[str, int, Values]  # topic, log_time [ns] and values


class PartStart(NamedTuple):
    """The first message of a new part, and the effective configuration that holds from there on."""

    config_yaml: str
    message: Message


Item = Reading | Message | PartStart


class Backlog:
    """A bounded queue that drops its oldest messages, and counts exactly."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._items: deque[Item] = deque()
        self._lock = threading.Lock()
        self._accepted = self._written = self._dropped = 0
        self._taken = 0  # on their way to the disk
        self._overflow = 0  # dropped since the last take
        self._config = ""  # of the last PartStart among them
        self._starts = 0  # PartStarts waiting

    def put(self, items: list[Item]) -> None:
        """Raises MemoryError, and nothing has changed."""
        with self._lock:
            accepted, before = self._accepted + len(items), len(self._items)
            starts = self._starts + (isinstance(items[0], PartStart) if items else 0)

            try:
                self._items.extend(items)
            except MemoryError:
                while len(self._items) > before:
                    self._items.pop()
                raise

            self._accepted, self._starts = accepted, starts
            self._drop_oldest(max(0, len(self._items) - self._capacity))

    def _drop_oldest(self, excess: int) -> None:
        for _ in range(excess):
            self._drop(self._items.popleft())
            self._dropped += 1
            self._overflow += 1

    def _drop(self, item: Item) -> None:
        if isinstance(item, PartStart):
            self._starts -= 1
            self._config = item.config_yaml

    def batches(self) -> int:
        """How many takes empty the queue as it is, or write the batch that waits."""
        return 1 + len(self._items) // BATCH + self._starts

    @property
    def starts(self) -> int:
        """PartStarts that wait."""
        return self._starts

    def take(self) -> tuple[list[Item], int, str]:
        """The next messages, how many were dropped before them since the last take, and the
        configuration of a PartStart among those. A PartStart comes first in its batch.
        """
        with self._lock:
            batch = list(islice(self._items, self._leading()))
            taken = self._taken + len(batch)
            lost, config = self._overflow, self._config

            # from here on nothing may fail: what is taken is counted
            for _ in batch:
                self._items.popleft()
            if batch and isinstance(batch[0], PartStart):
                self._starts -= 1

            self._taken, self._overflow, self._config = taken, 0, ""
        return batch, lost, config

    def _leading(self) -> int:
        """How many to take: up to the next PartStart, which is the first of its own batch."""
        following = islice(self._items, 1, BATCH)
        starts = (at for at, item in enumerate(following, 1) if isinstance(item, PartStart))
        return next(starts, min(BATCH, len(self._items)))

    def settle(self, dropped: int) -> None:
        """What was taken is written, but for those that could not be encoded."""
        with self._lock:
            written, dropped = self._written + self._taken - dropped, self._dropped + dropped
            self._written, self._dropped, self._taken = written, dropped, 0

    def drop_all(self) -> None:
        """Give up what is still here."""
        with self._lock:
            self._dropped += len(self._items) + self._taken
            self._taken = self._starts = 0
            self._items.clear()

    def counters(self) -> tuple[int, int, int, int]:
        """Accepted, written, dropped, queued."""
        with self._lock:
            return self._accepted, self._written, self._dropped, len(self._items) + self._taken
