"""The numbers of the messages of a file that we wrote: each channel counts on from one chunk to the
next. Where it does not, messages are missing, or a chunk stands in another place or twice.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from gritd.estimator.compiled.arithmetic import integer_sum

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


class ChunkSequence:
    """Follows the chunks of a file in file order."""

    def __init__(self) -> None:
        self._channels: dict[int, _Counted] = {}
        self._seen: set[int] = set()  # chunks, by their numbers

    @property
    def missing(self) -> int:
        """Messages that are missing between the first and the last."""
        return integer_sum(max(0, counted.missing) for counted in self._channels.values())

    def counts(self) -> dict[int, int]:
        """Messages by channel."""
        return {channel: counted.count for channel, counted in self._channels.items()}

    def repeated(self, chunk: Mapping[int, tuple[int, int, int]]) -> bool:
        """Whether a chunk (channel → first number, last number, messages) was there before."""
        key = hash(tuple(chunk.items()))
        before = key in self._seen
        self._seen.add(key)
        return before

    def add_all(self, chunks: Iterable[Mapping[int, tuple[int, int, int]]]) -> bool:
        """Count chunks that all count on from those before and were not there before; False, and
        nothing is counted, where one does not.
        """
        chunks = list(chunks)
        keys = [hash(tuple(chunk.items())) for chunk in chunks]
        lasts = {channel: counted.last for channel, counted in self._channels.items()}

        for chunk in chunks:
            for channel, (first, last, _) in chunk.items():
                if _ahead(first, lasts.get(channel, first - 1)) <= 0 or _ahead(last, first) < 0:
                    return False
                lasts[channel] = last
        if len(set(keys)) < len(keys) or not self._seen.isdisjoint(keys):
            return False

        self._seen.update(keys)
        for chunk in chunks:
            self.add(chunk)
        return True

    def add(self, chunk: Mapping[int, tuple[int, int, int]]) -> bool:
        """Count a chunk; whether all its channels count on from the chunks before."""
        in_place = True
        for channel, (first, last, count) in chunk.items():
            counted = self._channels.setdefault(channel, _Counted(first, first - 1))
            in_place &= _ahead(first, counted.last) > 0
            if _ahead(last, counted.last) > 0:
                counted.last = last
            if _ahead(first, counted.first) < 0:
                counted.first = first
            counted.count += count

        return in_place


def _ahead(number: int, other: int) -> int:
    """How far one number is ahead of another, through a wrap."""
    return (number - other + _WRAP // 2) % _WRAP - _WRAP // 2
