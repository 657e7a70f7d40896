"""What a service manager is sent: the sd_notify protocol, one datagram a message (man 3 sd_notify).

Without a service manager nothing is sent, and nobody has to ask.
"""

from __future__ import annotations

import errno
import os
import socket
import time
from collections import deque
from collections.abc import Mapping

READY, STOPPING, WATCHDOG = "READY=1", "STOPPING=1", "WATCHDOG=1"
_PASSING = ("STATUS=", WATCHDOG)  # soon said again; anything else is a state the manager waits for
_MOST = 16  # states that wait for a manager who is behind
_LATER = (errno.EAGAIN, errno.EMFILE, errno.ENFILE)  # what passes


def reloading() -> str:
    """That the configuration is being read again; READY ends it."""
    return f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}"


def extended(seconds: float) -> str:
    """That the start takes so long from now on."""
    return f"EXTEND_TIMEOUT_USEC={round(seconds * 1e6)}"


def status(text: str) -> str:
    """One line for people, shown by `systemctl status`."""
    return "STATUS=" + " ".join(text.split())


class Notifier:
    """The manager named by NOTIFY_SOCKET; `interval` [s] is how often its watchdog must be stroked,
    0 for never.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        wanted = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        timeout = environment.get("WATCHDOG_USEC", "0")
        self.interval = int(timeout) * 1e-6 / 3 if wanted and timeout.isdecimal() else 0.0
        self._waiting: deque[str] = deque(maxlen=_MOST)

    def tell(self, *messages: str) -> None:
        """Send what there is to say, as one datagram. Never waits and never raises: a manager that
        is gone is no reason to stop. A state that one who is behind could not take goes out first
        the next time.
        """
        if self._address:
            self._waiting.append("\n".join(messages))
            self._send()

    def _send(self) -> None:
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as out:
                while self._waiting:
                    out.sendto(self._waiting[0].encode(), self._address)
                    self._waiting.popleft()
        except OSError as error:
            later = error.errno in _LATER
            states = [text for text in self._waiting if later and not text.startswith(_PASSING)]
            self._waiting = deque(states, _MOST)
