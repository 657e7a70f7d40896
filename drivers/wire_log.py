"""A recorded wire: the chunks of one device with the time each came, before any decoding.

File: the line `gritd wire 1`, then records `i64 received [ns] | u32 length | bytes`, little-endian.
A CAN bus is recorded in the packing of framing_can. A log cut anywhere gives the records before the
cut.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.link import Chunk

MAGIC = b"gritd wire 1\n"
MAX_CHUNK = 1 << 20  # [bytes] a longer record is damage
_HEAD = struct.Struct("<qI")


class WireWriter:
    """Writes chunks as they come: the `tap` of a reader. Raises OSError if it cannot."""

    def __init__(self, path: str | Path) -> None:
        self._file = open(path, "wb")  # noqa: SIM115 - closed by close()
        self._file.write(MAGIC)

    def __call__(self, received: int, data: bytes) -> None:
        self._file.write(_HEAD.pack(received, len(data)) + data)

    def close(self) -> None:
        self._file.close()


def read_wire(path: str | Path) -> Iterator[Chunk]:
    """The chunks of a log, up to its end or its first damaged record. Raises DeviceSettingsError if
    it is no log.
    """
    try:
        file = open(path, "rb")  # noqa: SIM115 - closed below
    except OSError as error:
        raise DeviceSettingsError(str(path), error.strerror) from None
    with file:
        if file.read(len(MAGIC)) != MAGIC:
            raise DeviceSettingsError(
                str(path), "not a wire log, expected the line 'gritd wire 1' first"
            )
        while len(head := file.read(_HEAD.size)) == _HEAD.size:
            received, length = _HEAD.unpack(head)
            data = file.read(length) if length <= MAX_CHUNK else b""
            if len(data) != length:
                return
            yield Chunk(received, data)
