"""Who may see the page, and how."""

from __future__ import annotations

import asyncio
from typing import Any, NamedTuple

import pytest

pytest.importorskip("starlette", reason="needs gritd[view]")
from gritd.tools.view.app import FrameHub, live
from gritd.tools.view.feed import DaemonFeed
from gritd.tools.view.guard import BURST, Guard
from gritd.tools.view.library import library

TOKEN = "0123456789abcdef0123"
APP = live(DaemonFeed(None), library(), FrameHub())


class Answer(NamedTuple):
    code: int
    headers: dict[str, str]


def guard(token: str = "", everywhere: bool = False) -> Guard:
    return Guard(APP, ["localhost"], everywhere, token, clock=lambda: 0.0)


def asked(of: Guard, path: str = "/", method: str = "GET", **headers: str) -> Answer:
    """What a browser gets that asks at this guard."""
    given = {"host": "localhost:8250", **headers}
    scope: dict[str, Any] = {
        "type": "http", "http_version": "1.1", "method": method, "scheme": "http",
        "path": path.partition("?")[0], "query_string": path.partition("?")[2].encode(),
        "headers": [(k.replace("_", "-").encode(), v.encode()) for k, v in given.items()],
        "client": ("127.0.0.1", 1), "server": ("127.0.0.1", 8250), "root_path": "",
    }  # fmt: skip
    said: list[Any] = []

    async def send(message: Any) -> None:
        said.append(message)

    async def receive() -> Any:
        return {"type": "http.request", "body": b"", "more_body": False}

    asyncio.run(of(scope, receive, send))
    headers_of = {k.decode(): v.decode() for k, v in said[0]["headers"]}
    return Answer(said[0]["status"], headers_of)


def test_the_page_and_all_that_it_names_is_served_from_here_alone() -> None:
    page = asked(guard())
    assert page.code == 200 and page.headers["content-type"].startswith("text/html")
    policy = page.headers["content-security-policy"]
    assert "default-src 'none'" in policy and "unsafe" not in policy and "http" not in policy
    for name in ("style.css", "main.js", "uplot.js", "uplot.css", "about", "events", "stretch"):
        assert asked(guard(), f"/{name}").code == 200, name


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "HEAD", "PATCH"])
def test_get_only(method: str) -> None:
    assert asked(guard(), method=method).code == 405


@pytest.mark.parametrize("header", [{"content_length": "1"}, {"transfer_encoding": "chunked"}])
def test_a_body_is_not_taken(header: dict[str, str]) -> None:
    assert asked(guard(), **header).code == 413


@pytest.mark.parametrize(
    "host, everywhere, code",
    [
        ("localhost", False, 200),
        ("LOCALHOST:9999", False, 200),
        ("evil.example", False, 421),
        ("10.0.0.7", False, 421),
        ("localhost.evil.example", True, 421),
        ("10.0.0.7:8250", True, 200),
        ("[fd00::7]:8250", True, 200),
        ("", True, 421),
    ],
)
def test_a_request_that_is_meant_for_another_host_is_refused(
    host: str, everywhere: bool, code: int
) -> None:
    assert asked(guard(everywhere=everywhere), host=host).code == code


def test_without_the_token_nothing_is_seen() -> None:
    for path in ("/", "/about", "/live", "/style.css", "/?token=wrong", "/?token=%ff"):
        assert asked(guard(TOKEN), path).code == 401
    assert asked(guard(TOKEN), cookie="gritd_view=wrong").code == 401

    onward = asked(guard(TOKEN), f"/?token={TOKEN}")
    assert onward.code == 303 and onward.headers["location"] == "/"
    cookie = onward.headers["set-cookie"]
    assert "httponly" in cookie.lower() and "samesite=strict" in cookie.lower()
    assert asked(guard(TOKEN), cookie=cookie.partition(";")[0]).code == 200


def test_an_address_that_asks_too_often_waits() -> None:
    of = guard()
    codes = [asked(of, "/style.css").code for _ in range(int(BURST) + 2)]
    assert codes == [200] * int(BURST) + [429] * 2


@pytest.mark.parametrize(
    "query",
    ["points=x", "seconds=nan", "seconds=-1", "from=1", "from=2&to=1", "from=inf&to=inf"],
)
def test_a_stretch_that_makes_no_sense_is_refused(query: str) -> None:
    assert asked(guard(), f"/stretch?{query}").code == 400
