"""Binary frames, byte-stuffed (COBS) and ended by a zero byte.

Body before stuffing, little-endian:

    u16 sequence | u8 kind of the values | u8 length of the key, bit 7 set if a time follows
    | key | [u32 device_us] | values, all of one kind
    | u16 CRC-16 (CCITT, initial value 0xFFFF) of all before it

Kinds are the letters of Python's struct: i int32, I uint32, q int64, f float32, d float64. The
body is at most 253 bytes, so one stuffing code, below 0xFF, covers any run. A damaged zero byte
joins two frames: a fault costs the frame it hits and at most the next.

COBS: S. Cheshire, M. Baker, Consistent Overhead Byte Stuffing, IEEE/ACM Trans. Networking 7
(1999) 159–172.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx

from gritd.drivers.framing import KEY, MAX_VALUES, Frame, SerialFraming

MAX_BODY = 253
MAX_STUFFED = MAX_BODY + 1

_SIZES = {ord(kind): struct.calcsize("<" + kind) for kind in "iIqfd"}
_HEAD = struct.Struct("<HBB")
_TIMED = 0x80


def encode(frame: Frame, kind: str | None = None) -> bytes:
    """The frame on the wire, its closing zero included.

    kind: one of i, I, q, f, d for all values; by default the narrowest integer, or d where any
    value is a float. Raises struct.error if a value does not fit the kind, ValueError if the
    frame is too long.
    """
    kind = kind or _narrowest(frame)
    key = frame.key.encode("ascii")
    timed = frame.device_us is not None

    body = _HEAD.pack(frame.sequence or 0, ord(kind), len(key) | (_TIMED if timed else 0)) + key
    if frame.device_us is not None:
        body += struct.pack("<I", frame.device_us)
    body += struct.pack(f"<{len(frame.values)}{kind}", *frame.values)
    body += struct.pack("<H", crc_hqx(body, 0xFFFF))
    if len(body) > MAX_BODY:
        raise ValueError(f"frame of {len(body)} bytes, expected at most {MAX_BODY}")

    return _stuff(body) + b"\0"


def _narrowest(frame: Frame) -> str:
    if any(isinstance(value, float) for value in frame.values):
        return "d"
    low, high = min(frame.values), max(frame.values)
    if low >= -(1 << 31) and high < 1 << 31:
        return "i"
    return "I" if low >= 0 and high < 1 << 32 else "q"


def _stuff(body: bytes) -> bytes:
    """Each run between zeros is preceded by its length plus one."""
    return b"".join(bytes((len(run) + 1,)) + run for run in body.split(b"\0"))


def _unstuff(stuffed: bytes) -> bytes | None:
    """The body, or None if the run lengths do not add up."""
    runs = []
    at = 0
    while at < len(stuffed):
        end = at + stuffed[at]
        if end > len(stuffed):
            return None
        runs.append(stuffed[at + 1 : end])
        at = end
    return b"\0".join(runs)


class CobsFraming(SerialFraming):
    """Incremental decoder of stuffed binary frames; keeps at most MAX_STUFFED bytes between
    chunks.
    """

    def __init__(self) -> None:
        super().__init__()
        self._overlong = False

    def reset(self) -> None:
        super().reset()
        self._overlong = False

    def decode(self, chunk: bytes) -> list[Frame]:
        *pieces, last = (self._pending + chunk).split(b"\0")
        frames = [frame for frame in map(self._piece, pieces) if frame is not None]
        self._keep(last)
        return frames

    def _keep(self, last: bytes) -> None:
        """Hold the unfinished frame, unless it is already longer than any frame."""
        if len(last) > MAX_STUFFED:
            self.counts.garbage += len(last)
            self._overlong = True
            last = b""
        self._pending = last

    def _piece(self, stuffed: bytes) -> Frame | None:
        """The frame between two zeros, counted."""
        overlong, self._overlong = self._overlong, False
        frame = None if overlong or len(stuffed) > MAX_STUFFED else _parse(stuffed)
        if frame is None or frame.sequence is None:
            self.counts.garbage += len(stuffed) + 1
            self.counts.bad += bool(stuffed) or overlong
            return None
        self.counts.good += 1
        self.counts.lost += self._gap.lost_before(frame.sequence)
        return frame


def _parse(stuffed: bytes) -> Frame | None:
    """The frame of one stuffed piece, or None if its checksum or its content is wrong."""
    body = _unstuff(stuffed)
    if (
        body is None
        or len(body) < _HEAD.size + 2
        or crc_hqx(body[:-2], 0xFFFF) != int.from_bytes(body[-2:], "little")
    ):
        return None

    sequence, kind, key_length = _HEAD.unpack_from(body)
    key_end = _HEAD.size + (key_length & ~_TIMED)
    values_at = key_end + (4 if key_length & _TIMED else 0)
    key = body[_HEAD.size : key_end].decode("latin-1")
    count, rest = divmod(len(body) - 2 - values_at, _SIZES.get(kind, 1))
    if kind not in _SIZES or rest or not 1 <= count <= MAX_VALUES or not KEY.fullmatch(key):
        return None

    device_us = int.from_bytes(body[key_end:values_at], "little") if key_length & _TIMED else None
    return Frame(
        key, sequence, device_us, struct.unpack_from(f"<{count}{chr(kind)}", body, values_at)
    )
