"""What the daemon shows of itself: JSON lines over a Unix stream socket, ten a second at most, to
whoever connects.

A thread of its own asks for a report only while somebody listens, so the loop is never waited for
nor waits. A client that does not read loses its connection. Nothing that a client sends is looked
at. Who may connect is decided by the permissions of the socket file: the daemon's user and group.
"""

from __future__ import annotations

import errno
import json
import math
import os
import selectors
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread
from typing import Any

from gritd.estimator.threads.waiting import wait_until

INTERVAL = 0.1  # [s] between lines
BREATH = 0.01  # [s] between attempts to take somebody in who cannot be, for want of descriptors
MAX_CLIENTS = 16
STOP = 0.5  # [s] the longest a stop waits
MODE = 0o660
LONGEST = 107  # [bytes] of the path of a Unix socket
REFUSED = "refused"  # key of the only line that is no report

Report = Callable[[], Mapping[str, Any]]


FULL = b'{"%s":"%d readers are connected, which is the most"}\n' % (REFUSED.encode(), MAX_CLIENTS)


class PublishError(Exception):
    """The socket cannot be made: one line."""


class Publisher:
    """Serves `report()` at `path`. Raises PublishError."""

    def __init__(self, path: Path, report: Report) -> None:
        self.path = path
        self._report = report
        self._listener = _listener(path)
        self._clients: list[socket.socket] = []
        self._stop = Event()
        self._thread = Thread(target=self._run, name="publisher", daemon=True)

    @property
    def alive(self) -> bool:
        return self._thread.is_alive()

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        """End the thread, close every connection and remove the socket file."""
        self._stop.set()
        wait_until(lambda: not self.alive, STOP)
        for connection in (*self._clients, self._listener):
            connection.close()
        with suppress(OSError):
            self.path.unlink()

    def _run(self) -> None:
        with selectors.DefaultSelector() as waiting:
            waiting.register(self._listener, selectors.EVENT_READ)
            while not self._stop.wait(INTERVAL if self._clients else BREATH):
                self._listen_again(waiting)
                if waiting.select(0.0 if self._clients else INTERVAL):
                    self._accept()
                if self._clients:
                    self._send(line_of(self._report()))

    def _listen_again(self, waiting: selectors.BaseSelector) -> None:
        """Make the socket anew where somebody removed it, or its folder, which is there again."""
        if os.path.lexists(self.path) or not self.path.parent.is_dir():
            return
        with suppress(PublishError):  # it is tried again
            listener = _listener(self.path)
            waiting.unregister(self._listener)
            self._listener.close()
            waiting.register(listener, selectors.EVENT_READ)
            self._listener = listener

    def _accept(self) -> None:
        """Take in everybody who waits; there is room for MAX_CLIENTS."""
        with suppress(OSError):  # nobody else waits, or one has left already
            while True:
                client, _ = self._listener.accept()
                if len(self._clients) < MAX_CLIENTS:
                    client.setblocking(False)
                    self._clients.append(client)
                else:
                    client.send(FULL, socket.MSG_NOSIGNAL)
                    client.close()

    def _send(self, line: bytes) -> None:
        for client in list(self._clients):
            try:
                whole = client.send(line, socket.MSG_NOSIGNAL) == len(line)
            except OSError:  # it left, or its buffer is full
                whole = False
            if not whole:
                client.close()
                self._clients.remove(client)


def line_of(report: Mapping[str, Any]) -> bytes:
    """One line of strict JSON; what is not finite becomes null."""
    return json.dumps(_strict(report), separators=(",", ":"), ensure_ascii=False).encode() + b"\n"


def _strict(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _strict(item) for key, item in value.items()}
    return [_strict(item) for item in value] if isinstance(value, list | tuple) else value


def _listener(path: Path) -> socket.socket:
    """A listening socket at `path`, in place of one that a dead daemon left."""
    if len(os.fsencode(path)) > LONGEST:
        raise PublishError(f"{path}: longer than {LONGEST} bytes, which a Unix socket cannot be")

    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
    try:
        if path.is_socket():
            path.unlink()
        _bind(listener, path)
        listener.listen(MAX_CLIENTS)
    except OSError as error:
        listener.close()
        reason = (
            "a file of this name is there" if error.errno == errno.EADDRINUSE else error.strerror
        )
        raise PublishError(f"{path}: cannot make the status socket: {reason}") from None

    return listener


def _bind(listener: socket.socket, path: Path) -> None:
    """Bind, with no moment in which others than user and group could connect."""
    before = os.umask(0o777 & ~MODE)
    try:
        listener.bind(str(path))
    finally:
        os.umask(before)
