"""An open port read as fast as the system gives it: one wait and one read for whatever is there."""

from __future__ import annotations

import errno
import os
import select

from gritd.drivers.link import POLL

ROOM = 1 << 12  # [bytes] taken at once: what a terminal of the kernel holds, 3 ms of decoding


class Port:
    """The bytes behind a file descriptor that somebody else opens and closes."""

    def __init__(self, fileno: int) -> None:
        self._fileno = fileno
        self._ready = select.poll()
        self._ready.register(fileno, select.POLLIN)

    def read(self) -> bytes:
        """What came: all of it, of a socket one datagram; nothing after POLL of silence. Raises
        OSError, also where the device is gone.
        """
        if not self._ready.poll(POLL * 1e3):
            return b""

        try:
            data = os.read(self._fileno, ROOM)
        except BlockingIOError:  # another process was quicker
            return b""

        if not data:  # ready, and nothing there: the port has hung up
            raise OSError(errno.ENODEV, os.strerror(errno.ENODEV))
        return data
