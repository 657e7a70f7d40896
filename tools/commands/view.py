"""`gritd view`: the running daemon in a browser, through its status socket; or recordings."""

from __future__ import annotations

import asyncio
import os
import socket
from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from gritd.tools.cli.command import DONE, USAGE, CommandError, Parser, whole
from gritd.tools.cli.optional import require
from gritd.tools.cli.progress import Progress
from gritd.tools.recordings.catalogue import runs_of
from gritd.tools.service.client import add_socket

if TYPE_CHECKING:
    from gritd.tools.view.app import FrameHub
    from gritd.tools.view.foxglove import Relay
    from gritd.tools.view.server import ListenAddress

NEEDS = ("starlette", "uvicorn")
FOXGLOVE = 8765  # the port that Foxglove looks at
BEHIND = 5  # nice: the page waits for the daemon, never the daemon for the page
DEFAULT_PORT = 8250
MOST = 50  # recordings of a page
EXPECTED = "expected a first line of 16 characters or more, as openssl rand -hex 16 gives"


def main(argv: Sequence[str]) -> int:
    """Exit 0 after SIGTERM or Ctrl-C. Raises CommandError."""
    arguments = build_parser().parse_args(argv)
    for package in NEEDS:
        require(package, "gritd view")
    if arguments.foxglove is not None:
        require("foxglove", "gritd view --foxglove")
    _serve(arguments)
    return DONE


def _serve(arguments: Namespace) -> None:
    """Raises CommandError."""
    from gritd.tools.view.library import library
    from gritd.tools.view.server import ListenAddress

    place = ListenAddress(arguments.host, arguments.port, tuple(arguments.name), _token(arguments))
    if not place.loopback and not place.token:
        raise CommandError(
            f"--host {place.host}: found no --token-file; expected one, since others can reach this"
            " address; its first line is what they need to look",
            USAGE,
        )

    if arguments.foxglove is not None and (arguments.files or not place.loopback):
        where = "recordings" if arguments.files else f"--host {place.host}"
        expected = "expected the running daemon, seen from this computer alone: it asks no token"
        raise CommandError(f"--foxglove: found {where}; {expected} (docs/view.md)", USAGE)

    serve = _recorded if arguments.files else _live
    serve(arguments, place, library())


def _live(arguments: Namespace, place: ListenAddress, files: Mapping[str, Path]) -> None:
    """The running daemon."""
    from gritd.tools.view.app import FrameHub, live
    from gritd.tools.view.feed import DaemonFeed
    from gritd.tools.view.server import listening, serve

    hub, feed = FrameHub(), DaemonFeed(arguments.socket)
    with (
        closing(listening(place, arguments.any_port)) as listener,
        _relaying(arguments.foxglove, place) as relay,
        closing(feed),
    ):

        def begin() -> None:
            loop = asyncio.get_running_loop()
            feed.start(lambda frame: _push(loop, hub, frame), relay.take if relay else None)
            _announce(place, listener)
            if relay:
                print(f"foxglove ws://{place.host}:{relay.port}/", flush=True)

        with suppress(OSError):
            os.nice(BEHIND)
        serve(live(feed, files, hub), place, listener, begin)


@contextmanager
def _relaying(port: int | None, place: ListenAddress) -> Iterator[Relay | None]:
    """Raises CommandError where the port is not free."""
    if port is None:
        yield None
        return
    from gritd.tools.view.foxglove import Relay

    with closing(Relay(place.host, port)) as relay:
        yield relay


def _recorded(arguments: Namespace, place: ListenAddress, files: Mapping[str, Path]) -> None:
    """Recordings. Raises CommandError."""
    from gritd.tools.view.app import recorded
    from gritd.tools.view.campaign import ViewedCampaign
    from gritd.tools.view.recorded import Recordings
    from gritd.tools.view.server import listening, serve

    paths = _paths(arguments.files)
    with Progress("a first look", len(paths)) as progress:
        recordings = Recordings(paths, progress.advance)
    campaign = ViewedCampaign(paths)
    with closing(listening(place, arguments.any_port)) as listener:

        def begin() -> None:
            recordings.start()
            campaign.start()
            _announce(place, listener)

        serve(recorded(recordings, campaign, files), place, listener, begin)


def _paths(given: Sequence[Path]) -> list[Path]:
    """The recordings: those that are named, and the runs of a folder that is. Raises CommandError
    where there are none, or more than a page is for.
    """
    found = [run for path in given for run in (runs_of(path) if path.is_dir() else [path])]
    if not 0 < len(found) <= MOST:
        expected = f"expected 1 to {MOST}: gritd runs lists them"
        raise CommandError(f"{given[0]}: found {len(found)} recordings; {expected}", USAGE)
    return found


def _announce(place: ListenAddress, listener: socket.socket) -> None:
    print(f"view {place.address(listener.getsockname()[1])}", flush=True)


def _push(loop: asyncio.AbstractEventLoop, hub: FrameHub, frame: bytes) -> None:
    """From the feed's thread, also while the server ends."""
    with suppress(RuntimeError):
        loop.call_soon_threadsafe(hub.push, frame)


def _token(arguments: Namespace) -> str:
    """The token of the file that is named. Raises CommandError."""
    if arguments.token_file is None:
        return ""
    from gritd.tools.view.server import token_of

    try:
        lines = arguments.token_file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "no text"
        raise CommandError(
            f"{arguments.token_file}: found {reason.lower()}; {EXPECTED}", USAGE
        ) from None
    token = token_of(lines)
    if not token:
        raise CommandError(f"{arguments.token_file}: found no token; {EXPECTED}", USAGE)
    return token


def build_parser() -> Parser:
    parser = Parser(
        prog="gritd view", description="Show the running daemon, or recordings, in a browser."
    )
    parser.add_argument(
        "files",
        nargs="*",
        type=Path,
        metavar="FILE",
        help="recordings, or folders of them, in place of the daemon",
    )
    add_socket(parser)
    parser.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="where to listen (default: 127.0.0.1, this computer alone)",
    )
    parser.add_argument(
        "--port",
        type=whole(0, 65535),
        default=DEFAULT_PORT,
        metavar="N",
        help=f"default {DEFAULT_PORT}; 0 for any that is free",
    )
    parser.add_argument(
        "--any-port", action="store_true", help="where the port is taken: any that is free"
    )
    parser.add_argument(
        "--name",
        action="append",
        default=[],
        metavar="HOST",
        help="a further name under which browsers reach this computer",
    )
    parser.add_argument(
        "--foxglove",
        nargs="?",
        type=whole(0, 65535),
        const=FOXGLOVE,
        metavar="N",
        help=f"serve /tick, /update and /loop to Foxglove too, at port N (default {FOXGLOVE})",
    )
    parser.add_argument(
        "--token-file",
        type=Path,
        metavar="F",
        help="the first line of F must be known to look; needed beyond this computer",
    )
    return parser
