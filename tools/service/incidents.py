"""How often something is said: a count that goes up again and again, lines about one subject."""

from __future__ import annotations

from collections import deque

from gritd.estimator.daemon.notice import Notice

PAUSE = 60.0  # [s] between two lines about a count that goes on and on
OVER = 5.0  # [s] without a further one, and it is over
BURST = 30  # lines about one subject at once; then …
REFILL = 1.0  # [s] … one in this time


class Recurring:
    """A counter of faults: said where it begins to go up, once a minute while it does, and where
    that is over, with how many there were.
    """

    def __init__(self, what: str, total: int = 0) -> None:
        self._what, self._total = what, total
        self._count = self._reported = 0  # since it began, and how many of them were said
        self._began = self._moved = 0.0
        self._said = -PAUSE

    def look(self, total: int, now: float) -> Notice | None:
        """total: of the counter; now: [s]."""
        new, self._total = total - self._total, total
        if new > 0:
            self._began = self._began if self._count else now
            self._count, self._moved = self._count + new, now
        if self._count > self._reported and now - self._said >= PAUSE:
            return self._go_on(now)
        if self._reported and now - self._moved >= OVER:
            return self._end()
        return None

    def _go_on(self, now: float) -> Notice:
        in_all = f", {self._count} in all" * (self._reported > 0)
        text = f"{self._what}: {self._count - self._reported}{in_all}"
        self._reported, self._said = self._count, now
        return Notice(text)

    def _end(self) -> Notice | None:
        """What was said in full needs no second line."""
        count, reported, self._count, self._reported = self._count, self._reported, 0, 0
        if count == reported:
            return None
        lasted = self._moved - self._began
        return Notice(f"{self._what}: over after {lasted:.1f} s, {count} in all", over=True)


class Limited:
    """Lines about one subject, not too many. What was left out is counted, and the last of it said
    when there is room: it is how things stand.
    """

    def __init__(self) -> None:
        self._room, self._at = float(BURST), 0.0
        self._waiting: deque[Notice] = deque(maxlen=1)
        self._left_out = 0

    def offer(self, notice: Notice) -> None:
        """A line to say."""
        self._left_out += len(self._waiting)
        self._waiting.append(notice)

    def due(self, now: float) -> Notice | None:
        """What may be said now [s]."""
        self._room = min(self._room + (now - self._at) / REFILL, float(BURST))
        self._at = now
        if not self._waiting or self._room < 1.0:
            return None

        self._room -= 1.0
        notice, left_out, self._left_out = self._waiting.popleft(), self._left_out, 0
        more = f" ({left_out} lines before this one were left out)" * (left_out > 0)
        return notice._replace(text=notice.text + more)
