"""CAN messages as frames: signals picked by name from a message database.

A chunk holds whole messages, each packed as `u32 id and flags | u8 length | 3 bytes zero | data`
(the head of Linux' can_frame), so that a recorded CAN bus and a recorded serial port are the same
kind of log.

A wanted key is `Message.Signal` (one value) or `Message` (all its data signals in the order of
their start bits).
Three signal names are not data: `Sequence` or `Cycle` is the message counter, `DeviceTime` the
    node's clock [µs].
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NoReturn

import cantools
from cantools.database import Database
from cantools.database.can import Message, Signal

from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.framing import Counts, FieldValue, Frame, SequenceGap

EXTENDED = 1 << 31
REMOTE = 1 << 30
ERROR = 1 << 29
HEAD = struct.Struct("<IB3x")

COUNTERS = ("sequence", "cycle")
DEVICE_TIME = "devicetime"


def pack(can_id: int, data: bytes) -> bytes:
    """One message as a chunk. can_id carries the flags EXTENDED, REMOTE, ERROR. Raises struct.error
    out of range.
    """
    return HEAD.pack(can_id, len(data)) + data


@dataclass
class _Wanted:
    """A message that some channel listens to."""

    message: Message
    picks: dict[str, tuple[str, ...]]  # key -> names of the signals that make its values
    counter: Signal | None
    device_time: Signal | None
    gap: SequenceGap

    @property
    def clock_modulus(self) -> int:
        """Where the node's clock wraps [µs]."""
        if self.device_time is None:
            return 1 << 32
        return int(self.device_time.scale * (1 << self.device_time.length))


class CanFraming:
    """Decoder of packed CAN messages. `keys` are the wanted ones; other messages are ignored,
    uncounted.

    Raises DeviceSettingsError for a key that the database does not hold.
    """

    def __init__(self, device: str, database: Database, keys: Iterable[str]) -> None:
        self.counts = Counts()
        self._device = device
        self._database = database
        self._wanted: dict[int, _Wanted] = {}
        self._by_message: dict[str, _Wanted] = {}
        for key in keys:
            self._want(key)

    def filters(self) -> list[dict[str, int | bool]]:
        """Acceptance filters for exactly the wanted ids, as python-can takes them."""
        return [
            {
                "can_id": w.message.frame_id,
                "can_mask": (1 << 29) - 1,
                "extended": bool(w.message.is_extended_frame),
            }
            for w in self._wanted.values()
        ]

    def signals(self, key: str) -> list[Signal]:
        """The data signals behind a wanted key, in the order of its values."""
        wanted = self._by_message[key.partition(".")[0]]
        return [wanted.message.get_signal_by_name(name) for name in wanted.picks[key]]

    def has_counter(self, key: str) -> bool:
        """Whether the key's message carries a `Sequence` or `Cycle` counter."""
        return self._by_message[key.partition(".")[0]].counter is not None

    def clock_modulus(self, key: str) -> int:
        return self._by_message[key.partition(".")[0]].clock_modulus

    def reset(self) -> None:
        for wanted in self._wanted.values():
            wanted.gap.expected = None

    def decode(self, chunk: bytes) -> list[Frame]:
        frames: list[Frame] = []
        at = 0

        while len(chunk) - at >= HEAD.size:
            can_id, length = HEAD.unpack_from(chunk, at)
            data_at = at + HEAD.size
            if data_at + length > len(chunk):
                break
            frames += self._message(can_id, chunk[data_at : data_at + length])
            at = data_at + length

        self.counts.garbage += len(chunk) - at
        return frames

    def _message(self, can_id: int, data: bytes) -> list[Frame]:
        """The frames of one message, counted."""
        if can_id & ERROR:
            self.counts.errors += 1
            return []

        wanted = self._wanted.get(can_id)
        if wanted is None:
            return []

        try:
            values = wanted.message.decode(data, decode_choices=False)
        except (cantools.Error, ValueError, ArithmeticError):
            self.counts.bad += 1
            return []

        self.counts.good += 1
        return self._frames(wanted, values)  # type: ignore[arg-type]

    def _frames(self, wanted: _Wanted, values: dict[str, FieldValue]) -> list[Frame]:
        sequence = device_us = None
        if wanted.counter is not None:
            sequence = int(values[wanted.counter.name])
            self.counts.lost += wanted.gap.lost_before(sequence)

        if wanted.device_time is not None:
            device_us = int(values[wanted.device_time.name])

        # a multiplexed message carries some of its signals
        return [
            Frame(key, sequence, device_us, tuple(values[name] for name in names))
            for key, names in wanted.picks.items()
            if all(name in values for name in names)
        ]

    def _want(self, key: str) -> None:
        name, _, signal = key.partition(".")
        wanted = self._by_message.get(name) or self._listen(name)
        data = tuple(
            s.name
            for s in wanted.message.signals
            if s is not wanted.counter and s is not wanted.device_time
        )

        names = (signal,) if signal else data
        if not names or not set(names) <= set(data):
            self._unknown(f"signal {key}", f"{name} has {', '.join(data) or 'no data signals'}")
        wanted.picks[key] = names

    def _listen(self, name: str) -> _Wanted:
        """Start listening to the message of this name."""
        message = next((m for m in self._database.messages if m.name == name), None)
        if message is None:
            self._unknown(
                f"message {name}", f"there are {', '.join(m.name for m in self._database.messages)}"
            )

        counter = next((s for s in message.signals if s.name.lower() in COUNTERS), None)
        device_time = next((s for s in message.signals if s.name.lower() == DEVICE_TIME), None)
        for signal in filter(None, (counter, device_time)):
            if signal.is_float or signal.multiplexer_ids:
                kind = "a float" if signal.is_float else "multiplexed"
                what = f"signal {name}.{signal.name} is {kind}"
                raise DeviceSettingsError(
                    f"device {self._device}", f"{what}; expected an integer in every message"
                )

        gap = SequenceGap(1 << counter.length if counter else 1)
        wanted = _Wanted(message, {}, counter, device_time, gap)
        self._wanted[message.frame_id | (EXTENDED if message.is_extended_frame else 0)] = wanted
        self._by_message[name] = wanted

        return wanted

    def _unknown(self, what: str, known: str) -> NoReturn:
        raise DeviceSettingsError(f"device {self._device}", f"no {what} in its database; {known}")
