"""The status socket from the other side: reports of the running daemon."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from gritd.estimator.visible import visible
from gritd.tools.cli.command import CommandError, Parser

SOCKET = "gritd.sock"
PLACES = (Path("/run/gritd") / SOCKET, Path("runs") / SOCKET)
PATIENCE = 10.0  # [s] with a daemon, or a computer, that is held up
MAX_LINE = 1 << 20  # [bytes] of a report
NO_GRITD = "what answers on this socket is no gritd"

Report = dict[str, Any]


def add_socket(parser: Parser) -> None:
    """The option that says where the daemon is."""
    places = ", then ".join(map(str, PLACES))
    parser.add_argument(
        "--socket", metavar="PATH", help=f"the daemon's status socket (default: {places})"
    )


def connected(given: str | None) -> socket.socket:
    """A connection to the daemon. Raises CommandError."""
    path = Path(given) if given else next((place for place in PLACES if place.exists()), PLACES[-1])
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.settimeout(PATIENCE)
    try:
        connection.connect(os.fsencode(path))
    except OSError as error:
        connection.close()
        raise CommandError(
            f"{path}: no daemon answers: {(error.strerror or str(error)).lower()}"
        ) from None
    return connection


def reports(connection: socket.socket) -> Iterator[Report]:
    """The reports as they come. Raises CommandError where the daemon ends or is silent."""
    waiting = b""
    while True:
        line, newline, rest = waiting.partition(b"\n")
        if newline:
            waiting = rest
            yield _parsed(line)
        else:
            waiting += _more(connection, MAX_LINE - len(waiting))


def _more(connection: socket.socket, room: int) -> bytes:
    try:
        data = connection.recv(min(1 << 16, room))
    except OSError as error:
        raise CommandError(f"the daemon is silent: {str(error).lower()}") from None
    if not data:
        raise CommandError("the daemon has ended")
    return data


def _parsed(line: bytes) -> Report:
    try:
        report = json.loads(line)
    except (ValueError, RecursionError):
        report = None
    if (
        not isinstance(report, dict)
        or not {"healthy", "status", "tick", "loop", "log", "devices"} <= report.keys()
    ):
        raise CommandError(NO_GRITD)
    return report


def told(form: Callable[[Report], Iterator[str]], report: Report) -> list[str]:
    """A report in lines, whoever sent it. Raises CommandError where a field is missing."""
    try:
        return [visible(line) for line in form(report)]
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
        raise CommandError(NO_GRITD) from None
