"""What is served: the page, what it must know, stretches of curves, and the stream of frames."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from importlib import resources
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import BaseRoute, Route

from gritd.estimator.daemon.publish import line_of
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.terramechanics.soil import Array

if TYPE_CHECKING:  # the one does not load what the other needs
    from gritd.tools.view.campaign import ViewedCampaign
    from gritd.tools.view.feed import DaemonFeed
    from gritd.tools.view.recorded import Recordings
    from gritd.tools.view.run_curves import Along

STREAMS = 64  # browsers that may follow at once
MOST_POINTS = 4000  # of a curve
QUIET = 10.0  # [s] without a frame: a comment keeps the connection
KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}
PAGE = resources.files("gritd.tools.view").joinpath("page")


class FrameHub:
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


def live(feed: DaemonFeed, library: Mapping[str, Path], hub: FrameHub) -> Starlette:
    """The page of the running daemon."""

    async def about(request: Request) -> Response:
        return JSONResponse(feed.described())

    async def events(request: Request) -> Response:
        return JSONResponse(feed.events())

    async def stretch(request: Request) -> Response:
        if (asked := Asked.of(request)) is None:
            return _senseless()
        return await asyncio.to_thread(
            lambda: packed(*feed.stretch(asked.span, asked.seconds, asked.points))
        )

    async def stream(request: Request) -> Response:
        if hub.streams >= STREAMS:
            return PlainTextResponse("no place left to follow\n", 503)
        return StreamingResponse(hub.frames(), media_type="text/event-stream")

    answers = {"/about": about, "/events": events, "/stretch": stretch, "/live": stream}
    return _application(answers, library)


def recorded(
    recordings: Recordings, campaign: ViewedCampaign, library: Mapping[str, Path]
) -> Starlette:
    """The page of recordings."""

    async def about(request: Request) -> Response:
        return JSONResponse(recordings.described())

    async def events(request: Request) -> Response:
        if (asked := Asked.of(request, len(recordings.runs))) is None:
            return _senseless()
        return JSONResponse(await asyncio.to_thread(recordings.events, asked.run))

    async def stretch(request: Request) -> Response:
        if (asked := Asked.of(request, len(recordings.runs))) is None:
            return _senseless()
        return await asyncio.to_thread(
            lambda: packed(*recordings.stretch(asked.run, asked.along, asked.span, asked.points))
        )

    async def moment(request: Request) -> Response:
        if (asked := Asked.of(request, len(recordings.runs))) is None:
            return _senseless()
        found = await asyncio.to_thread(recordings.moment, asked.run, asked.along, asked.at)
        return Response(line_of(found), media_type="application/json")

    async def difference(request: Request) -> Response:
        asked = Asked.of(request, len(recordings.runs))
        if asked is None or not 0 <= asked.other < len(recordings.runs):
            return _senseless()
        try:
            found = await asyncio.to_thread(recordings.differences, asked.run, asked.other)
        except (OSError, RecordingError) as error:
            return PlainTextResponse(f"{error}\n", 404)
        return JSONResponse(found)

    async def forces(request: Request) -> Response:
        return Response(line_of(campaign.answer), media_type="application/json")

    answers = {"/about": about, "/events": events, "/stretch": stretch, "/moment": moment}
    answers |= {"/campaign": forces, "/diff": difference}
    return _application(answers, library)


Answer = Callable[[Request], Awaitable[Response]]


def _application(answers: Mapping[str, Answer], library: Mapping[str, Path]) -> Starlette:
    routes = [Route(path, answer) for path, answer in answers.items()]
    return Starlette(routes=[*routes, *_files(library)])


def _senseless() -> Response:
    return PlainTextResponse("expected numbers that make sense\n", 400)


class Asked(NamedTuple):
    """What a request asks for."""

    span: tuple[float, float] | None
    seconds: float
    points: int
    run: int
    along: Along
    at: float
    other: int  # run

    @classmethod
    def of(cls, request: Request, runs: int = 1) -> Asked | None:
        """None where it makes no sense."""
        given = request.query_params
        try:
            span = (float(given["from"]), float(given["to"])) if "from" in given else None
            asked = cls(
                span,
                float(given.get("seconds", "60")),
                min(int(given.get("points", "1200")), MOST_POINTS),
                int(given.get("run", "0")),
                "way" if given.get("along") == "way" else "time",
                float(given.get("at", "0")),
                int(given.get("other", "0")),
            )
        except (ValueError, KeyError):
            return None

        finite = all(map(isfinite, (asked.seconds, asked.at, *(span or ()))))
        forward = asked.seconds > 0.0 and (span is None or span[0] < span[1])
        return asked if finite and forward and asked.points >= 2 and 0 <= asked.run < runs else None


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


def packed(time: Array, columns: Array, way: Array) -> Response:
    """Little-endian: counts of points, columns and points of the way as three int32 and one more
    of nothing; times as float64; then each column, and both of the way, as float32.
    """
    counts = np.array([len(time), columns.shape[1], len(way), 0], "<i4")
    parts = (counts, time.astype("<f8"), columns.T.astype("<f4"), way.T.astype("<f4"))
    return Response(
        b"".join(part.tobytes() for part in parts), media_type="application/octet-stream"
    )
