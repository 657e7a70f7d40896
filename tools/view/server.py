"""The server: where it listens, whom it lets in, and what an endless or silent client costs."""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import logging
import signal
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import uvicorn
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from gritd.tools.cli.command import FAILED, USAGE, CommandError
from gritd.tools.view.guard import LOOPBACK, Guard

PORT = 8250
CONNECTIONS = 256  # in all
FROM_ONE = 128  # from one address
IDLE = 10.0  # [s] a connection may wait without a request
UNREAD = 20_000  # [ms] the kernel waits for a client that takes nothing
HEAD = 16 << 10  # [bytes] of a request's head


@dataclass(frozen=True)
class ListenAddress:
    """Where to listen, and whom to let in."""

    host: str = "127.0.0.1"
    port: int = PORT
    names: tuple[str, ...] = ()  # under which others reach this computer
    token: str = ""

    @property
    def loopback(self) -> bool:
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    @property
    def everywhere(self) -> bool:
        return self.host in ("0.0.0.0", "::")

    def guarded(self, app: ASGIApp) -> Guard:
        own = () if self.loopback else (self.host, socket.gethostname())
        return Guard(app, (*LOOPBACK, *own, *self.names), self.everywhere, self.token)

    def address(self, port: int) -> str:
        """What to open in a browser."""
        host = socket.gethostname() if self.everywhere else self.host
        shown = f"[{host}]" if ":" in host else host
        return f"http://{shown}:{port}/" + (f"?token={self.token}" if self.token else "")


class Connection(H11Protocol):
    """One client: refused where there are too many, dropped where it waits or takes nothing."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        address = _address(transport)
        same = sum(_address(other.transport) == address for other in self.connections)
        if len(self.connections) >= CONNECTIONS or same >= FROM_ONE:
            transport.abort()
            return

        super().connection_made(transport)
        if (own := transport.get_extra_info("socket")) is not None:
            own.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNREAD)
        self._looked: Any = self
        self.loop.call_later(IDLE, self._look)

    def _look(self) -> None:
        """Drop it where no request was under way, now and at the last look."""
        if self.transport.is_closing():
            return
        idle = self.cycle is None or self.cycle.response_complete
        if idle and (self.cycle is None or self.cycle is self._looked):
            self.transport.abort()
            return
        self._looked = self.cycle
        self.loop.call_later(IDLE, self._look)


def _address(transport: asyncio.BaseTransport) -> str:
    peer = transport.get_extra_info("peername")
    return str(peer[0]) if peer else ""


def listening(place: ListenAddress, elsewhere: bool = False) -> socket.socket:
    """A socket at the place; where its port is taken and `elsewhere`, at a free one. Raises
    CommandError.
    """
    family = socket.AF_INET6 if ":" in place.host else socket.AF_INET
    try:
        return socket.create_server((place.host, place.port), family=family, backlog=64)
    except OSError as error:
        if elsewhere and error.errno == errno.EADDRINUSE:
            return socket.create_server((place.host, 0), family=family, backlog=64)
        taken = error.errno == errno.EADDRINUSE
        found = "found it taken" if taken else f"found {(error.strerror or str(error)).lower()}"
        raise CommandError(
            f"{place.host} port {place.port}: {found}; expected an address of this computer and a"
            " free port (--host, --port; 0 for any)",
            FAILED if taken else USAGE,
        ) from None


def serve(
    app: ASGIApp,
    place: ListenAddress,
    listener: socket.socket,
    begun: Callable[[], None] = lambda: None,
) -> None:
    """Serve until SIGTERM or SIGINT. `begun` is called in the loop before the first request."""

    async def run() -> None:
        begun()
        await server.serve([listener])

    logging.getLogger("uvicorn").setLevel(logging.CRITICAL)  # clients that leave or talk nonsense
    server = Server(_config(place.guarded(app)))
    asyncio.run(run())


class Server(uvicorn.Server):
    """One that a signal ends as if nothing more had to be said of it."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        numbers = (signal.SIGINT, signal.SIGTERM)
        before = [signal.signal(number, self.handle_exit) for number in numbers]
        try:
            yield
        finally:
            for number, handler in zip(numbers, before, strict=True):
                signal.signal(number, handler)


def _config(app: ASGIApp) -> uvicorn.Config:
    return uvicorn.Config(
        app,
        http=Connection,
        ws="none",
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,
        timeout_keep_alive=5,
        timeout_graceful_shutdown=1,
        h11_max_incomplete_event_size=HEAD,
        backlog=64,
    )


def token_of(lines: Sequence[str]) -> str:
    """The token of a file's lines: the first, of 16 characters or more. Empty where it is not."""
    first = lines[0].strip() if lines else ""
    return first if len(first) >= 16 and first.isascii() and first.isprintable() else ""
