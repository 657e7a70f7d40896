"""A serial port, real, USB or pseudo-terminal."""

from __future__ import annotations

import errno
import os
import termios
from contextlib import suppress

import serial

from gritd.drivers.errors import DeviceError
from gritd.drivers.link import POLL, Chunk, Clock
from gritd.drivers.port import Port
from gritd.drivers.port_lock import in_use

# what pyserial lets through; SerialException is an OSError
_FAILURES = (OSError, ValueError, TypeError, termios.error)


class SerialLink:
    """Reads whatever is there, as soon as there is something. The port is locked against a second
    reader.
    """

    def __init__(self, device: str, port: str, baud: int, clock: Clock) -> None:
        self.damaged = 0
        self._device = device
        self._path = port
        self._baud = baud
        self._clock = clock
        self._port: serial.Serial | None = None
        self._bytes: Port | None = None

    def open(self) -> None:
        try:
            self._port = serial.Serial(self._path, self._baud, timeout=POLL, exclusive=True)
            self._bytes = Port(self._port.fileno())
        except _FAILURES as error:
            locked = getattr(error, "errno", None) == errno.EWOULDBLOCK
            reason = in_use(self._path) if locked else _reason(error)
            raise DeviceError(self._device, f"cannot open {self._path}: {reason}") from None

    def read(self) -> Chunk | None:
        if self._bytes is None:
            raise DeviceError(self._device, f"{self._path} is not open")
        try:
            data = self._bytes.read()
            return Chunk(self._clock(), data) if data else None  # no byte of it came later
        except _FAILURES as error:
            raise DeviceError(self._device, f"cannot read {self._path}: {_reason(error)}") from None

    def close(self) -> None:
        if self._port is not None:
            with suppress(*_FAILURES):
                self._port.close()
        self._port = self._bytes = None


def _reason(error: Exception) -> str:
    """The operating system's words where there are some, with the remedy for the usual one."""
    number = getattr(error, "errno", None)
    if number is None:
        return str(error)
    hint = " (is the user in the port's group, often dialout?)" if number == errno.EACCES else ""
    return os.strerror(number) + hint
