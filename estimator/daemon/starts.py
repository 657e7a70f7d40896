"""Starts in quick succession: a daemon that ends again and again is started more and more slowly,
and never given up.

The service manager starts it anew within a fraction of a second. From the sixth time on, each
within a minute of the one before, a start waits first: 1, 2, 4, … 30 s.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

NAME = "starts"  # file in the runtime directory: how many in a row, and when the last one was [s]
AT_ONCE = 5  # starts in a row that do not wait
LONGEST = 30.0  # [s] of a wait
SETTLED = 60.0  # [s] of running after which a start is the first again


def wait_before(folder: Path, now: float) -> float:
    """How long this start has to wait [s]; remembers it. now: of a clock that only goes on [s].

    What cannot be read or written is no reason not to start.
    """
    streak, last = _read(folder / NAME)
    streak = streak + 1 if 0.0 <= now - last <= SETTLED else 1
    late = streak - AT_ONCE
    wait = min(2.0 ** min(late - 1, 10), LONGEST) if late > 0 else 0.0

    with suppress(OSError):
        (folder / NAME).write_text(f"{streak} {now + wait}\n", encoding="ascii")
    return wait


def forget(folder: Path) -> None:
    """The daemon ended as it was asked to: the next start is the first again."""
    with suppress(OSError):
        (folder / NAME).unlink()


def _read(path: Path) -> tuple[int, float]:
    """How many starts in a row, and the last; none where there is no such file."""
    try:
        streak, last = path.read_text(encoding="ascii").split()
        return int(streak), float(last)
    except (OSError, ValueError):
        return 0, -SETTLED
