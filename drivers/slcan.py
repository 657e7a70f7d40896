"""Messages of a serial CAN adapter (slcan, Lawicel's ASCII protocol), read in one piece.

python-can opens and closes the adapter. It asks the system twice for every byte, which at
4,000 messages a second takes two thirds of a core; here all that has come is read at once.

A line is `t`, 3 hexadecimal digits of the identifier, a digit of the length, the data in
hexadecimal, and \\r; some adapters end it with \\r\\n or \\n. `T` has 8 digits of an extended
identifier, `r` and `R` are remote frames, `d` `b` and `D` `B` those of CAN FD. What the adapter
answers to a command is no message; any other line is damaged.
"""

from __future__ import annotations

import re
from collections.abc import Container

from gritd.drivers.can_libraries import CAN_FD_DLC
from gritd.drivers.framing_can import EXTENDED, REMOTE, pack

LONGEST_LINE = 4096  # [bytes] kept of a line that does not end; a message takes 32
_ENDS = re.compile(rb"[\r\n\a]")  # done; the adapter reports an error
_ANSWERS = ("z", "Z", "V", "v", "N", "F", "A")  # sent; versions, serial number, status, polled all
_KINDS = {  # what a line begins with -> digits of the identifier, flags
    "t": (3, 0),
    "d": (3, 0),
    "b": (3, 0),
    "T": (8, EXTENDED),
    "x": (8, EXTENDED),  # of a CANDapter
    "D": (8, EXTENDED),
    "B": (8, EXTENDED),
    "r": (3, REMOTE),
    "R": (8, EXTENDED | REMOTE),
}


class SlcanLines:
    """Incremental decoder of an adapter's lines: pieces of bytes in, messages packed for CanFraming
    out; keeps at most LONGEST_LINE bytes between pieces.

    wanted: identifiers with their flags; other messages are left out.
    """

    def __init__(self, wanted: Container[int]) -> None:
        self._wanted = wanted
        self._pending = b""

    @property
    def pending(self) -> int:
        """Bytes of the unfinished line."""
        return len(self._pending)

    def decode(self, piece: bytes) -> tuple[bytes, int]:
        """The messages whose lines this piece completes, and how many lines are damaged or never
        ended. Never raises.
        """
        *lines, self._pending = _ENDS.split(self._pending + piece)
        messages, damaged = [], 0
        if len(self._pending) > LONGEST_LINE:  # as of a wrong baud rate
            damaged, self._pending = 1, b""

        for line in filter(None, lines):
            try:
                can_id, data = _parsed(line.decode("ascii"))
            except ValueError:
                damaged += 1
                continue
            if can_id in self._wanted:
                messages.append(pack(can_id, data))

        return b"".join(messages), damaged


def _parsed(line: str) -> tuple[int, bytes]:
    """Identifier with its flags, and data; -1 for an answer of the adapter. Raises ValueError for a
    damaged line.
    """
    digits, flags = _KINDS.get(line[0], (0, 0))
    if not line.isalnum() or not (digits or line[0] in _ANSWERS):
        raise ValueError(line)
    if not digits:
        return -1, b""

    start = digits + 2
    length = int(line[start - 1 : start], 16)
    if line[0] in "dDbB":
        length = CAN_FD_DLC[length]
    if flags & REMOTE:
        length = 0

    data = bytes.fromhex(line[start : start + 2 * length])
    if len(data) != length:
        raise ValueError(line)
    return int(line[1 : digits + 1], 16) | flags, data
