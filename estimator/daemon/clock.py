"""The daemon's one clock: nanoseconds since the epoch, set once from the wall, driven by the
monotonic clock.
"""

from __future__ import annotations

import time


class Clock:
    """Never steps. `wall_offset` tells how far the wall clock has moved away from it since the
    start.
    """

    def __init__(self) -> None:
        self._origin = time.time_ns() - time.monotonic_ns()

    def now(self) -> int:
        """[ns]"""
        return time.monotonic_ns() + self._origin

    def wall_offset(self) -> float:
        """Wall clock minus this clock [s]: 0 until somebody sets the wall clock."""
        return (time.time_ns() - self.now()) * 1e-9

    def sleep_until(self, deadline: int) -> None:
        """Return at or after the deadline [ns]; at once if it has passed."""
        remaining = deadline - self.now()
        if remaining > 0:
            time.sleep(remaining * 1e-9)
