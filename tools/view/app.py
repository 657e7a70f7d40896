"""What is served: the page, what it must know, stretches of curves, and the stream of frames."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Mapping
from importlib import resources
from math import isfinite
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import BaseRoute, Route

from gritd.estimator.terramechanics.soil import Array

STREAMS = 64  # browsers that may follow at once
MOST_POINTS = 4000  # of a curve
QUIET = 10.0  # [s] without a frame: a comment keeps the connection
KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}
PAGE = resources.files("gritd.tools.view").joinpath("page")


class Shown(Protocol):
    """What a page shows: the running daemon, or recordings."""

    def described(self) -> dict[str, Any]: ...

    def events(self) -> list[dict[str, Any]]: ...

    def stretch(
        self, span: tuple[float, float] | None, seconds: float, points: int
    ) -> tuple[Array, Array, Array]: ...


class Hub:
    """The newest frame, for whoever follows. One that reads slowly gets fewer frames, and nothing
    is kept for it.
    """

    def __init__(self) -> None:
        self.streams = 0
        self._frame = b""
        self._new = asyncio.Event()

    def push(self, frame: bytes) -> None:
        self._frame = frame
        self._new.set()
        self._new = asyncio.Event()

    async def frames(self) -> AsyncIterator[bytes]:
        """Server-sent events, without end."""
        self.streams += 1
        try:
            yield b"retry: 1000\n\n"
            if self._frame:
                yield b"data: %s\n\n" % self._frame
            while True:
                new = self._new
                try:
                    await asyncio.wait_for(new.wait(), QUIET)
                    yield b"data: %s\n\n" % self._frame
                except TimeoutError:
                    yield b": quiet\n\n"
        finally:
            self.streams -= 1


def application(shown: Shown, library: Mapping[str, Path], hub: Hub | None) -> Starlette:
    """The application; with a hub there is a stream of frames."""

    async def about(request: Request) -> Response:
        return JSONResponse(shown.described())

    async def events(request: Request) -> Response:
        return JSONResponse(shown.events())

    async def stretch(request: Request) -> Response:
        asked = _asked(request)
        if asked is None:
            return PlainTextResponse("expected from and to, or seconds; and points\n", 400)
        return await asyncio.to_thread(lambda: packed(*shown.stretch(*asked)))

    async def live(request: Request) -> Response:
        if hub is None or hub.streams >= STREAMS:
            return PlainTextResponse("no place left to follow\n", 503)
        return StreamingResponse(hub.frames(), media_type="text/event-stream")

    routes: list[BaseRoute] = [
        Route("/about", about),
        Route("/events", events),
        Route("/stretch", stretch),
        Route("/live", live),
        *_files(library),
    ]
    return Starlette(routes=routes)


def _files(library: Mapping[str, Path]) -> list[BaseRoute]:
    """The page's own files, read once, and the library's where they lie."""
    own = [_file(item.name, item.read_bytes()) for item in PAGE.iterdir() if item.is_file()]
    theirs = [_file(name, path.read_bytes()) for name, path in library.items()]
    return [*own, *theirs]


def _file(name: str, content: bytes) -> BaseRoute:
    kind = KINDS[Path(name).suffix]

    async def answer(request: Request) -> Response:
        return Response(content, media_type=kind)

    return Route("/" if name == "index.html" else f"/{name}", answer)


def _asked(request: Request) -> tuple[tuple[float, float] | None, float, int] | None:
    """Span, seconds and points of a request; None where they make no sense."""
    given = request.query_params
    try:
        points = min(int(given.get("points", "1200")), MOST_POINTS)
        seconds = float(given.get("seconds", "60"))
        span = (float(given["from"]), float(given["to"])) if "from" in given else None
    except (ValueError, KeyError):
        return None
    finite = all(map(isfinite, (seconds, *(span or ()))))
    sensible = points >= 2 and seconds > 0.0 and (span is None or span[0] < span[1])
    return (span, seconds, points) if finite and sensible else None


def packed(time: Array, columns: Array, way: Array) -> Response:
    """Little-endian: counts of points, columns and points of the way as three int32 and one more
    of nothing; times as float64; then each column, and both of the way, as float32.
    """
    counts = np.array([len(time), columns.shape[1], len(way), 0], "<i4")
    parts = (counts, time.astype("<f8"), columns.T.astype("<f4"), way.T.astype("<f4"))
    return Response(
        b"".join(part.tobytes() for part in parts), media_type="application/octet-stream"
    )
