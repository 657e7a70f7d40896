"""The daemon's one clock: nanoseconds since the epoch, set once from the wall, driven by the
monotonic clock.

A recording keeps seconds as int32, as ROS does, which ends on 2038-01-19. A wall clock that cannot
be right at the start (a computer without a battery wakes in 1970) is not believed: the time since
the computer started then counts from FALLBACK, and `notice` says so.
"""

from __future__ import annotations

import time
from datetime import UTC, datetime, timedelta

NS = 1_000_000_000
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
# Before this program was written, or with too little left for a run of a year.
BELIEVED = (datetime(2020, 1, 1, tzinfo=UTC), datetime(2037, 1, 1, tzinfo=UTC))
FALLBACK = datetime(2000, 1, 1, tzinfo=UTC)


LAST = 2**63 - 1  # [ns] 11 April 2262: the system tells no later time in nanoseconds


def wall_ns() -> int:
    """The wall clock [ns since the epoch]; LAST where it is later than that."""
    try:
        return time.time_ns()
    except OverflowError:
        return LAST


class Clock:
    """Never steps. `wall_offset` tells how far the wall clock is away from it.

    notice: why its stamps are not of the calendar; "" as a rule.
    """

    def __init__(self) -> None:
        wall = wall_ns()
        believed = _ns(BELIEVED[0]) <= wall < _ns(BELIEVED[1])
        self.notice = "" if believed else _notice(wall)
        self._origin = wall - time.monotonic_ns() if believed else _ns(FALLBACK)

    def now(self) -> int:
        """[ns]"""
        return time.monotonic_ns() + self._origin

    def wall_offset(self) -> float:
        """Wall clock minus this clock [s]. Where the wall clock was believed, 0 until somebody sets
        it.
        """
        return (wall_ns() - self.now()) * 1e-9

    def sleep_until(self, deadline: int) -> None:
        """Return at or after the deadline [ns]; at once if it has passed."""
        remaining = deadline - self.now()
        if remaining > 0:
            time.sleep(remaining * 1e-9)


def _ns(moment: datetime) -> int:
    return round((moment - EPOCH).total_seconds()) * NS


def _notice(wall: int) -> str:
    date = EPOCH + timedelta(seconds=wall // NS)
    return (
        f"the wall clock says {date:%Y-%m-%d %H:%M:%S}, which is not believed: stamps are the time "
        f"since the computer started, counted from {FALLBACK:%Y-%m-%d}"
    )
