r"""Checksummed ASCII lines: `$key,sequence,device_us,value[,value…]*CCCC\r\n`.

CCCC is the CRC-16 (CCITT, initial value 0xFFFF) of everything between `$` and `*`, four hexadecimal
digits: NMEA's one-byte exclusive or would miss one damaged line in 256. `device_us` may be empty. A
value of digits only is an integer, any other a float. `$` never occurs inside a line, so the next
`$` starts afresh, even where the line's end is missing: a fault costs the line it hits and no
other.
"""

from __future__ import annotations

import re
from binascii import crc_hqx

from gritd.drivers.framing import (
    CLOCK_MODULUS,
    KEY,
    MAX_VALUES,
    SEQUENCE_MODULUS,
    FieldValue,
    Frame,
    SerialFraming,
)

MAX_LINE = 512  # [bytes] from `$` to the line's end

_INTEGER = re.compile(r"[+-]?[0-9]{1,19}")
_FLOAT = re.compile(r"[+-]?(?:[0-9.eE+-]{1,32}|nan|inf)")


def encode(frame: Frame) -> bytes:
    """The line of a frame. Floats are written so that reading them gives the same float."""
    device_us = "" if frame.device_us is None else str(frame.device_us)
    values = (
        repr(float(value)) if isinstance(value, float) else str(int(value))
        for value in frame.values
    )
    body = ",".join([frame.key, str(frame.sequence or 0), device_us, *values]).encode("ascii")
    return b"$%b*%04X\r\n" % (body, crc_hqx(body, 0xFFFF))


class AsciiFraming(SerialFraming):
    """Incremental decoder of checksummed lines; keeps at most MAX_LINE bytes between chunks."""

    def decode(self, chunk: bytes) -> list[Frame]:
        head, *lines = (self._pending + chunk).split(b"$")
        self.counts.garbage += len(head)
        self._pending = self._unfinished(lines)
        frames = (self._line(line) for line in lines)
        return [frame for frame in frames if frame is not None]

    def _unfinished(self, lines: list[bytes]) -> bytes:
        """Take the last line off if its end may yet come."""
        if lines and b"\n" not in lines[-1] and len(lines[-1]) < MAX_LINE:
            return b"$" + lines.pop()
        return b""

    def _line(self, text: bytes) -> Frame | None:
        """The frame of what follows one `$`, counted."""
        line, _, rest = text.partition(b"\n")
        frame = _parse(line.removesuffix(b"\r")) if len(line) < MAX_LINE else None

        if frame is None or frame.sequence is None:
            self.counts.bad += 1
            self.counts.garbage += 1 + len(text)
            return None

        self.counts.good += 1
        self.counts.garbage += len(rest)
        self.counts.lost += self._gap.lost_before(frame.sequence)
        return frame


def _parse(line: bytes) -> Frame | None:
    """The frame of `key,sequence,device_us,values*CCCC`, or None."""
    body, _, checksum = line.rpartition(b"*")
    if checksum != b"%04X" % crc_hqx(body, 0xFFFF) or not body.isascii():
        return None

    key, *fields = body.decode("ascii").split(",")
    if not KEY.fullmatch(key) or not 3 <= len(fields) <= 2 + MAX_VALUES:
        return None

    try:
        return Frame(
            key,
            _below(SEQUENCE_MODULUS, fields[0]),
            _device_us(fields[1]),
            tuple(map(_value, fields[2:])),
        )
    except ValueError:
        return None


def _below(limit: int, text: str) -> int:
    number = int(text) if text.isdigit() and len(text) <= 10 else limit
    if number >= limit:
        raise ValueError(text)
    return number


def _device_us(text: str) -> int | None:
    return _below(CLOCK_MODULUS, text) if text else None


def _value(text: str) -> FieldValue:
    if _INTEGER.fullmatch(text):
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    raise ValueError(text)
