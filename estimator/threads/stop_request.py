"""The wish that a loop should end, as a signal handler may utter it.

`threading.Event` will not do: its lock is not reentrant, and a handler runs in the main thread
between any two instructions, so also while that thread holds the lock inside `wait`. `set` would
then wait for ever for itself.
"""

from __future__ import annotations

from contextlib import suppress
from queue import Empty, SimpleQueue


class StopRequest:
    """Set once, by any thread or signal handler; waited for by one thread."""

    def __init__(self) -> None:
        self._set = False
        self._wake: SimpleQueue[None] = SimpleQueue()  # its put is reentrant

    def set(self) -> None:
        self._set = True
        self._wake.put(None)

    def is_set(self) -> bool:
        return self._set

    def wait(self, timeout: float) -> bool:
        """Whether it is set, now or within the time [s]."""
        if not self._set:
            with suppress(Empty):
                self._wake.get(timeout=timeout)
        return self._set
