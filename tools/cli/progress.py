"""Progress on standard error for whatever takes longer than two seconds: a line rewritten on a
terminal, a line from time to time elsewhere.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import TracebackType

from gritd.tools.cli.terminal import LiveLine

QUIET = 2.0  # [s] nothing is shown before
FEW = 0.01  # share done from which the time left is stated
EVERY = {True: 0.2, False: 5.0}  # [s] between lines on a terminal, and elsewhere


class Progress:
    """Counts steps towards a total, or names the step that is being done."""

    shown = True  # a worker process, which nobody watches, sets it to False

    def __init__(self, what: str, total: int = 0) -> None:
        """total: 0 where it is unknown."""
        self._what, self._total, self._done = what, total, 0
        self._line = LiveLine(sys.stderr)
        self._start = self._last = time.monotonic()

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._line.clear()

    def advance(self, steps: int = 1) -> None:
        """So many steps more are done."""
        self._done += steps
        self._show(self._counted)

    def reached(self, done: int, total: int) -> None:
        """So many of so many steps are done."""
        self._total = total
        self.advance(done - self._done)

    def at(self, step: str, share: float = 0.0) -> None:
        """This step goes on, with about that share of the work done; 0 where nobody knows. A
        terminal shows it at once: the next one may be long in coming.
        """
        self._show(lambda elapsed: _named(step, share, elapsed), at_once=self._line.terminal)

    def _show(self, words: Callable[[float], str], at_once: bool = False) -> None:
        now = time.monotonic()
        due = now - self._start > QUIET and now - self._last > EVERY[self._line.terminal]

        if self.shown and (due or at_once):
            self._last = now
            self._line.show(f"{self._what}: {words(now - self._start)}")

    def _counted(self, elapsed: float) -> str:
        if not self._total:
            return f"{self._done}"
        left = elapsed * (self._total - self._done) / max(self._done, 1)
        return f"{self._done} of {self._total} ({self._done / self._total:.0%}), {left:.0f} s left"


def _named(step: str, share: float, elapsed: float) -> str:
    """A step, what is done and what is left by the time that the steps before it took."""
    if share <= FEW:
        return f"{step}, {elapsed:.0f} s"
    left = elapsed * (1.0 - share) / share
    return f"{step} (about {share:.0%}), {elapsed:.0f} s, about {left:.0f} s left"
