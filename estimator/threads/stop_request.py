"""The wish that a loop should end, as a signal handler may utter it.

`threading.Event` will not do: its lock is not reentrant, and a handler runs in the main thread
between any two instructions, so also while that thread holds the lock inside `wait`. `set` would
then wait for ever for itself. `queue.SimpleQueue` will not do either: on a busy machine the rest
of its timeout may become negative, which it takes for no timeout at all (CPython 3.11). A plain
lock, held until the stop is asked for, has neither fault.
"""

from __future__ import annotations

from contextlib import suppress
from threading import Lock


class StopRequest:
    """Set once, by any thread or signal handler; waited for by any."""

    def __init__(self) -> None:
        self._set = False
        self._not_yet = Lock()
        self._not_yet.acquire()

    def set(self) -> None:
        self._set = True
        with suppress(RuntimeError):  # released before
            self._not_yet.release()

    def is_set(self) -> bool:
        return self._set

    def wait(self, timeout: float) -> bool:
        """Whether it is set, now or within the time [s]."""
        if not self._set and self._not_yet.acquire(timeout=max(timeout, 0.0)):
            self.set()  # for the next one that waits
        return self._set
