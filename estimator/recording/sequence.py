"""The numbers of the messages of a file that we wrote: each channel counts on from one chunk to the
next. Where it does not, messages are missing, or a chunk stands in another place or twice.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gritd.estimator.compiled.arithmetic import integer_sum
from gritd.estimator.recording.decoding import MessageHeads

Ranges = Mapping[int, tuple[int, int, int]]  # channel -> first number, last number, messages
_WRAP = 1 << 32  # numbers begin again there


@dataclass
class _Counted:
    """The numbers of one channel so far."""

    first: int
    last: int
    count: int = 0

    @property
    def missing(self) -> int:
        return _ahead(self.last, self.first) + 1 - self.count


def ranges(chunk: MessageHeads) -> Ranges:
    """The messages' numbers, channel by channel."""
    numbers, groups = chunk.heads["sequence"], chunk.groups
    return {c: (int(numbers[n[0]]), int(numbers[n[-1]]), len(n)) for c, n in groups.items()}


def rising(chunk: MessageHeads) -> bool:
    """Whether each message has a later number than the one of its channel before it."""
    numbers = chunk.heads["sequence"]
    steps = [np.diff(numbers[own]).view(np.int32) for own in chunk.groups.values()]
    return bool(np.all(np.concatenate(steps) > 0))


class ChunkSequence:
    """Follows the chunks of a file in file order."""

    def __init__(self) -> None:
        self._channels: dict[int, _Counted] = {}

    @property
    def missing(self) -> int:
        """Messages that are missing between the first and the last."""
        return integer_sum(max(0, counted.missing) for counted in self._channels.values())

    def counts(self) -> dict[int, int]:
        """Messages by channel."""
        return {channel: counted.count for channel, counted in self._channels.items()}

    def follows(self, chunk: Ranges) -> bool:
        """Whether all channels of a chunk count on from the chunks before."""
        known = self._channels
        return all(_ahead(n[0], known[c].last) > 0 for c, n in chunk.items() if c in known)

    def add(self, chunk: Ranges) -> None:
        """Count a chunk, or neighbouring ones as one."""
        for channel, (first, last, count) in chunk.items():
            counted = self._channels.setdefault(channel, _Counted(first, first - 1))
            if _ahead(last, counted.last) > 0:
                counted.last = last
            if _ahead(first, counted.first) < 0:
                counted.first = first
            counted.count += count


def _ahead(number: int, other: int) -> int:
    """How far one number is ahead of another, through a wrap."""
    return (number - other + _WRAP // 2) % _WRAP - _WRAP // 2
