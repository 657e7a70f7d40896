"""What stands between the page and whoever asks for it: method, host, token, rate, headers."""

from __future__ import annotations

import hmac
import ipaddress
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable
from http.cookies import CookieError, SimpleCookie
from typing import NamedTuple
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

COOKIE = "gritd_view"
BURST, RATE = 400.0, 40.0  # requests of one address at once, and a second
ADDRESSES = 1024  # whose rate is remembered
LOOPBACK = ("localhost", "127.0.0.1", "::1")

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class Bucket(NamedTuple):
    """Requests that an address may still send, and when that was."""

    left: float
    at: float


class Guard:
    """ASGI middleware around the application.

    hosts: names and addresses that a request may be meant for, without port; `any_address`: any IP
    address too, where the server listens on all. token: without it, or a cookie that has it,
    nobody sees anything; empty where none is asked for.
    """

    def __init__(
        self,
        app: ASGIApp,
        hosts: Iterable[str],
        any_address: bool,
        token: str,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._app, self._hosts = app, frozenset(host.lower() for host in hosts)
        self._any_address, self._token, self._clock = any_address, token, clock
        self._buckets: OrderedDict[str, Bucket] = OrderedDict()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":  # the lifespan; websockets are switched off
            await self._app(scope, receive, send)
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(HEADERS)
            await send(message)

        answer = self._answer(scope) or self._app
        await answer(scope, receive, guarded)

    def _answer(self, scope: Scope) -> Response | None:
        """What is said instead of the page; None for whoever may see it."""
        headers = Headers(scope=scope)
        address = scope["client"][0] if scope.get("client") else ""
        if not self._in_time(address, self._clock()):
            return _plain("too many requests", 429)
        if not self._meant(headers.get("host", "")):
            return _plain("not meant for this host", 421)
        if scope["method"] != "GET":
            return _plain("GET only", 405, Allow="GET")
        if headers.get("content-length", "0") != "0" or "transfer-encoding" in headers:
            return _plain("no body is taken", 413)
        return self._identified(scope, headers) if self._token else None

    def _in_time(self, address: str, now: float) -> bool:
        """Whether the address has sent no more than it may."""
        bucket = self._buckets.pop(address, Bucket(BURST, now))
        left = min(bucket.left + RATE * (now - bucket.at), BURST)
        self._buckets[address] = Bucket(max(left - 1.0, 0.0), now)
        if len(self._buckets) > ADDRESSES:
            self._buckets.popitem(last=False)
        return left >= 1.0

    def _meant(self, host: str) -> bool:
        """Whether a request is meant for this server: another name in it is that of a page that
        would use the reader's browser to look here.
        """
        name = _without_port(host.lower())
        return name in self._hosts or (self._any_address and _is_address(name))

    def _identified(self, scope: Scope, headers: Headers) -> Response | None:
        """None with the right cookie; with the right token in the address the cookie, and on."""
        given = parse_qs(scope["query_string"].decode("ascii", "replace")).get("token", [""])[0]
        if scope["path"] == "/" and self._is_token(given):
            onward = RedirectResponse("/", 303)
            onward.set_cookie(COOKIE, self._token, httponly=True, samesite="strict")
            return onward
        if self._is_token(_cookie(headers)):
            return None
        return _plain("open the address that gritd view printed, with its token", 401)

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self._token.encode())


def _plain(text: str, code: int, **headers: str) -> Response:
    return PlainTextResponse(text + "\n", code, {**headers, "Connection": "close"})


def _without_port(host: str) -> str:
    if host.startswith("["):
        return host[1:].partition("]")[0]
    return host.partition(":")[0]


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _cookie(headers: Headers) -> str:
    try:
        found = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return ""
    return found.value if found else ""
