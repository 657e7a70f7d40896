"""A recorded wire: the chunks of one device with the time each came, before any decoding.

File: the line `gritd wire 1`, then records `i64 received [ns] | u32 length | bytes`, little-endian.
A record of length 0 says that the device was opened there. A CAN bus is recorded in the packing of
framing_can. A log cut anywhere gives the records before the cut.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

from gritd.drivers.errors import DeviceSettingsError
from gritd.drivers.link import Chunk

MAGIC = b"gritd wire 1\n"
MAX_CHUNK = 1 << 20  # [bytes] a longer record is damage
SUFFIX = ".wire"
_HEAD = struct.Struct("<qI")


def wire_path(folder: Path, device: str) -> Path:
    """The log of a device in a folder of wire logs; a name may hold what no file's name may."""
    return folder / f"{quote(device, safe=' ')}{SUFFIX}"


class WireWriter:
    """Keeps chunks as they come: the `tap` of a reader. The file must not be there yet.

    A file that cannot be written on is given up, and `error` says why: the reader reads on.
    mode: the file's permissions; None leaves them to the umask. Raises DeviceSettingsError if the
    file cannot be made.
    """

    def __init__(self, path: Path, mode: int | None = None) -> None:
        self.path = path
        self.bytes = 0  # of chunks kept
        self.error = ""
        try:
            self._file = open(path, "xb", buffering=0)  # noqa: SIM115 - closed by close()
            if mode is not None:
                os.fchmod(self._file.fileno(), mode)
            self._file.write(MAGIC)
        except OSError as error:
            raise DeviceSettingsError(str(path), error.strerror) from None

    def __call__(self, received: int, data: bytes) -> None:
        if self.error:
            return
        try:
            self._file.write(_HEAD.pack(received, len(data)) + data)
            self.bytes += len(data)
        except (OSError, ValueError) as error:
            self.error = getattr(error, "strerror", None) or str(error)

    def close(self) -> None:
        self._file.close()


def read_wire(path: Path) -> Iterator[Chunk]:
    """The chunks of a log, up to its end or its first damaged record. Raises DeviceSettingsError if
    it is no log.
    """
    try:
        if path.exists() and not path.is_file():
            raise DeviceSettingsError(str(path), "not a file, expected a wire log")
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
