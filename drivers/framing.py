"""What every framing shares: the frame, its counters, and the interface of a decoder.

A framing is fed chunks of any size, keeps at most a bounded remainder, and never raises on any
input.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple, Protocol

FieldValue = int | float

KEY = re.compile(r"[A-Za-z0-9_.-]{1,32}")
MAX_VALUES = 16
SEQUENCE_MODULUS = 1 << 16
CLOCK_MODULUS = 1 << 32  # [µs]


class Frame(NamedTuple):
    """One message of a device.

    key:       what was sampled; a channel of the configuration names it as its `signal`.
    sequence:  the device's message counter, or None where it sends none.
    device_us: the device's wrapping microsecond clock at the instant of the sample, or None.
    values:    integers or floats as sent; may be NaN or infinite: the sensor judges them.
    """

    key: str
    sequence: int | None
    device_us: int | None
    values: tuple[FieldValue, ...]


@dataclass
class FramingCounts:
    """Since the framing was created. Every byte fed in is in a good frame, in garbage, or still
    pending.
    """

    good: int = 0  # frames decoded
    bad: int = 0  # frames delimited, but of wrong checksum or content
    garbage: int = 0  # bytes outside good frames
    lost: int = 0  # sequence numbers that never came in a good frame
    errors: int = 0  # error frames of a CAN controller


class Framing(Protocol):
    """Chunks of bytes in, frames out."""

    counts: FramingCounts

    @property
    def hint(self) -> str:
        """What is likely wrong with the configuration, by what comes; '' as a rule."""
        ...

    def decode(self, chunk: bytes) -> list[Frame]:
        """The frames completed by this chunk, in the order of the wire. Never raises."""
        ...

    def clock_modulus(self, key: str) -> int:
        """At how many µs the clock that stamps the frames of this key wraps."""
        ...

    def reset(self) -> None:
        """Forget the unfinished frame and the last sequence number: the device was reopened."""
        ...


class SequenceGap:
    """Counts lost frames from a counter that wraps at `modulus`.

    A step of half the modulus or more is not believed as a loss: it is a device that started anew.
    """

    def __init__(self, modulus: int) -> None:
        self.modulus = modulus
        self.expected: int | None = None

    def lost_before(self, sequence: int) -> int:
        """How many frames are missing between the last one and this one."""
        gap = 0 if self.expected is None else (sequence - self.expected) % self.modulus
        self.expected = (sequence + 1) % self.modulus
        return gap if gap < self.modulus // 2 else 0


class SerialFraming:
    """What the framings of a byte stream keep between chunks: the unfinished frame."""

    hint = ""

    def __init__(self) -> None:
        self.counts = FramingCounts()
        self._pending = b""
        self._gap = SequenceGap(SEQUENCE_MODULUS)

    @property
    def pending(self) -> int:
        """Bytes of the unfinished frame."""
        return len(self._pending)

    def clock_modulus(self, key: str) -> int:
        return CLOCK_MODULUS

    def reset(self) -> None:
        self.counts.garbage += self.pending
        self._pending = b""
        self._gap.expected = None
