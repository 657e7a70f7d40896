"""Progress on standard error for whatever takes longer than two seconds: a line rewritten on a
terminal, else none.
"""

from __future__ import annotations

import sys
import time
from types import TracebackType

from gritd.estimator.visible import visible
from gritd.tools.cli.terminal import control

QUIET = 2.0  # [s] nothing is shown before
EVERY = {True: 0.2, False: 5.0}  # [s] between lines on a terminal, and elsewhere


class Progress:
    """Counts steps towards a total; a total of 0 is unknown."""

    def __init__(self, what: str, total: int = 0) -> None:
        self._what, self._total, self._done = what, total, 0
        self._terminal = sys.stderr.isatty()
        self._shown = False
        self._start = self._last = time.monotonic()

    def __enter__(self) -> Progress:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._shown and self._terminal:
            print(file=sys.stderr)

    def advance(self, steps: int = 1) -> None:
        self._done += steps
        now = time.monotonic()
        if now - self._start > QUIET and now - self._last > EVERY[self._terminal]:
            self._last = now
            self._show(now - self._start)

    def _show(self, elapsed: float) -> None:
        text = f"{visible(self._what)}: {self._done}"
        if self._total:
            left = elapsed * (self._total - self._done) / max(self._done, 1)
            text += f" of {self._total} ({self._done / self._total:.0%}), {left:.0f} s left"
        print(
            f"\r\033[K{text}" if self._terminal else text,
            end="" if self._terminal else "\n",
            file=control(sys.stderr),
            flush=True,
        )
        self._shown = True
