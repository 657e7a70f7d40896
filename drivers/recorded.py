"""Recorded wires in the place of hardware: the chunks of wire logs, through the drivers again.

`Playback` plays the wires of one run on the present clock, each chunk as long after the first of
all as when it was recorded: for the daemon and its readers. `decoded` gives the readings at once,
with their recorded times, so that an hour takes seconds.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from threading import Lock

from gritd.drivers.decoder import Decoder
from gritd.drivers.link import POLL, Chunk, Clock
from gritd.drivers.wire_log import read_wire
from gritd.estimator.messages.readings import NS, Reading


def decoded(chunks: Iterable[Chunk], decoder: Decoder) -> Iterator[Reading]:
    """The readings of recorded chunks, through the path a live device takes."""
    for chunk in chunks:
        if chunk.data:
            yield from decoder.decode(chunk.received, chunk.data)
        else:  # the device was opened here
            decoder.restart()


class Playback:
    """The wires of one run (device → log), played again on the present clock.

    It begins when the first link is opened, and all links keep their distances. Raises
    DeviceSettingsError where a log is none.
    """

    def __init__(self, wires: Mapping[str, Path], clock: Clock) -> None:
        firsts = [next(read_wire(path), None) for path in wires.values()]
        self._first = min((chunk.received for chunk in firsts if chunk), default=0)  # [ns]
        self._clock = clock
        self._shift: int | None = None  # from recorded to present times [ns]
        self._lock = Lock()
        self._links = {name: RecordedLink(read_wire(path), self) for name, path in wires.items()}

    def link(self, device: str) -> RecordedLink:
        """The place of a device's hardware."""
        return self._links[device]

    @property
    def over(self) -> bool:
        """Whether every wire has been played to its end."""
        return all(link.over for link in self._links.values())

    def begin(self) -> None:
        """From now on chunks are due."""
        with self._lock:
            if self._shift is None:
                self._shift = self._clock() - self._first

    def due(self, chunk: Chunk) -> int:
        """When a chunk comes, on the present clock [ns]."""
        assert self._shift is not None, "not begun"
        return chunk.received + self._shift

    def left(self, chunk: Chunk) -> int:
        """The time until then [ns]."""
        return self.due(chunk) - self._clock()


class RecordedLink:
    """A link whose hardware is a wire log; silent after its end."""

    def __init__(self, chunks: Iterator[Chunk], playback: Playback) -> None:
        self.damaged = 0
        self.over = False
        self._chunks, self._playback = chunks, playback
        self._next: Chunk | None = None

    def open(self) -> None:
        """Go on where it was left."""
        self._playback.begin()
        self._next = self._next or next(self._chunks, None)

    def read(self) -> Chunk | None:
        """The next chunk, when it is due; None after POLL of silence."""
        chunk = self._next
        if chunk is None:
            self.over = True
            time.sleep(POLL)
            return None

        left = self._playback.left(chunk) / NS
        time.sleep(min(max(left, 0.0), POLL))
        if left > POLL:
            return None
        self._next = next(self._chunks, None)
        return Chunk(self._playback.due(chunk), chunk.data)

    def close(self) -> None:
        """Nothing is open."""
