"""CAN messages as frames: signals picked by name from a message database.

A chunk holds whole messages, each packed as `u32 id and flags | u8 length | 3 bytes zero | data`
(the head of Linux' can_frame), so that a recorded CAN bus and a recorded serial port are the same
kind of log.

A wanted key is `Message.Signal` (one value) or `Message` (all its data signals in the order of
their start bits; none where it only says when a cycle was measured).
Three signal names are not data: `Sequence` or `Cycle` is the message counter, `DeviceTime` the
    node's clock [µs].

A message of SAE J1939 is known by its parameter group (PGN) and the address it comes from, whatever
its priority; where the database states the null address, by the first address that sends it. What
differs from a wanted message in the address alone is not read, but reported: `hint`.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NoReturn

from gritd.drivers.can_libraries import Database, Message, Signal, cantools
from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.framing import FieldValue, Frame, FramingCounts, SequenceGap

EXTENDED = 1 << 31
REMOTE = 1 << 30
ERROR = 1 << 29
HEAD = struct.Struct("<IB3x")

NULL_ADDRESS = 0xFE  # of J1939: nobody's, in a database anybody's
PEER_TO_PEER = 240  # PDU formats below this have the receiver's address in the next byte

COUNTERS = ("sequence", "cycle")
DEVICE_TIME = "devicetime"


def pack(can_id: int, data: bytes) -> bytes:
    """One message as a chunk. can_id carries the flags EXTENDED, REMOTE, ERROR. Raises struct.error
    out of range.
    """
    return HEAD.pack(can_id, len(data)) + data


def group_mask(can_id: int) -> int:
    """The bits of a 29-bit identifier that make its parameter group: page, PDU format and, where
    the message is for all, the format's extension.
    """
    return 0x3FF0000 if (can_id >> 16) & 0xFF < PEER_TO_PEER else 0x3FFFF00


@dataclass
class _Wanted:
    """A message that some channel listens to.

    sender: the address it comes from, of J1939; None before it came.
    strangers: identifiers of its group that differ in the address, by address.
    """

    message: Message
    picks: dict[str, tuple[str, ...]]  # key -> names of the signals that make its values
    counter: Signal | None
    device_time: Signal | None
    gap: SequenceGap
    sender: int | None = None
    came: bool = False
    strangers: dict[int, int] = field(default_factory=dict)

    @property
    def anybodys(self) -> bool:
        """Whether the database leaves open who sends it."""
        return self.message.protocol == "j1939" and self.message.frame_id & 0xFF == NULL_ADDRESS

    def sent_by(self, address: int) -> bool:
        """Whether a message of its group from this address is it."""
        if self.anybodys:
            self.sender = address if self.sender is None else self.sender
            return address == self.sender
        return self.message.protocol == "j1939" and address == self.message.frame_id & 0xFF

    @property
    def hint(self) -> str:
        """What to do where another address sends it; ''."""
        if not self.strangers or (self.came and not self.anybodys):
            return ""
        ids = " and ".join(f"0x{can_id:08X}" for can_id in list(self.strangers.values())[:2])
        group = (self.message.frame_id & group_mask(self.message.frame_id)) >> 8
        name = f"{self.message.name} (PGN {group})"
        if self.anybodys:
            return (
                f"{name}: read from address 0x{self.sender or 0:02X} alone, it comes as {ids} too; "
                "the database leaves open who sends it"
            )
        return f"{name}: comes as {ids}, but the database states 0x{self.message.frame_id:08X}"

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
        self.counts = FramingCounts()
        self._device = device
        self._database = database
        self._wanted: dict[int, _Wanted] = {}
        self._by_message: dict[str, _Wanted] = {}
        self._groups: dict[int, list[_Wanted]] = {}  # of 29-bit identifiers
        for key in keys:
            self._want(key)

    def filters(self) -> list[dict[str, int | bool]]:
        """Acceptance filters for the wanted ids, as python-can takes them; of 29 bits for their
        groups.
        """
        return [_filter(wanted.message) for wanted in self._wanted.values()]

    @property
    def hint(self) -> str:
        return "; ".join(hint for w in self._by_message.values() if (hint := w.hint))

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
            wanted.sender = None

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
        if wanted is None or wanted.anybodys:
            wanted = self._of_group(can_id)
        if wanted is None:
            return []
        wanted.came = True

        try:
            values = wanted.message.decode(data, decode_choices=False)
        except (cantools.Error, ValueError, ArithmeticError):
            self.counts.bad += 1
            return []

        self.counts.good += 1
        return self._frames(wanted, values)  # type: ignore[arg-type]

    def _of_group(self, can_id: int) -> _Wanted | None:
        """The wanted message that this is by group and address; where only the address differs,
        it is noted.
        """
        if not can_id & EXTENDED or can_id & REMOTE:
            return None
        bare = can_id & ~EXTENDED
        group = self._groups.get(bare & group_mask(bare), ())
        for wanted in group:
            if wanted.sent_by(bare & 0xFF):
                return wanted
        for wanted in group:
            wanted.strangers[bare & 0xFF] = bare
        return None

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
        dated = not signal and wanted.counter is not None and wanted.device_time is not None
        if not (names or dated) or not set(names) <= set(data):
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
        if message.is_extended_frame:
            group = message.frame_id & group_mask(message.frame_id)
            self._groups.setdefault(group, []).append(wanted)
        self._by_message[name] = wanted

        return wanted

    def _unknown(self, what: str, known: str) -> NoReturn:
        raise DeviceSettingsError(f"device {self._device}", f"no {what} in its database; {known}")


def _filter(message: Message) -> dict[str, int | bool]:
    extended = bool(message.is_extended_frame)
    mask = group_mask(message.frame_id) if extended else (1 << 29) - 1
    return {"can_id": message.frame_id, "can_mask": mask, "extended": extended}


class AcceptedIdentifiers:
    """The identifiers, with their flags, that acceptance filters let pass: for a link that has to
    do it itself.
    """

    def __init__(self, filters: Iterable[dict[str, int | bool]]) -> None:
        self._ids: dict[int, set[int]] = {}  # mask with flags -> identifiers under it
        for one in filters:
            mask = int(one["can_mask"]) | EXTENDED | REMOTE | ERROR
            own = int(one["can_id"]) | (EXTENDED if one["extended"] else 0)
            self._ids.setdefault(mask, set()).add(own & mask)

    def __contains__(self, can_id: object) -> bool:
        return isinstance(can_id, int) and any(can_id & m in ids for m, ids in self._ids.items())
