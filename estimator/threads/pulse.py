"""Whether the threads do their work: what counts must go on counting.

Seen by looks, not by time: a process that was stopped or starved looks less often too, and must not
take its own silence for a thread's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence


class Pulse:
    """A counter that has to move; `patience` is how many looks it may stand still."""

    def __init__(
        self,
        name: str,
        count: Callable[[], int],
        patience: int,
        inside: Callable[[], str] = str,
    ) -> None:
        """inside: what the thread is in just now, said after its name; '' for nothing special."""
        self.name, self.inside = name, inside
        self._count, self._patience = count, patience
        self._last = count()
        self._still = 0

    def beats(self) -> bool:
        """One look."""
        now = self._count()
        self._still = 0 if now != self._last else self._still + 1
        self._last = now
        return self._still < self._patience


def silent(pulses: Sequence[Pulse]) -> str:
    """Names of those that stand still; '' while all beat. One look at each."""
    still = [pulse for pulse in pulses if not pulse.beats()]
    return ", ".join([" in ".join(filter(None, (p.name, p.inside()))) for p in still])
