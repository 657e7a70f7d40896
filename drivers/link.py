"""What a link is: the hardware end of a device, raw chunks with the time they came."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

Clock = Callable[[], int]  # ns since the epoch; the daemon's monotonic clock

POLL = 0.05  # [s] the longest a read waits: a reader is stopped within this


class Chunk(NamedTuple):
    """Bytes as they came in one piece; of a recorded wire none where the device was opened."""

    received: int  # [ns]
    data: bytes


class Link(Protocol):
    """Serial port, CAN bus or recording. Every failure of the hardware is a DeviceError."""

    damaged: int  # messages the link's own layers could not read

    def open(self) -> None:
        """Raises DeviceError if it cannot be opened; nothing is left open then."""
        ...

    def read(self) -> Chunk | None:
        """What came, or None after POLL of silence. Raises DeviceError."""
        ...

    def close(self) -> None:
        """Never raises; may be called twice, from the reader's thread."""
        ...
