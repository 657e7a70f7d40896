"""The status socket from the other side: reports of the running daemon."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from gritd.estimator.daemon.publish import REFUSED
from gritd.estimator.visible import visible
from gritd.tools.cli.command import CommandError, Parser

SOCKET = "gritd.sock"
PLACES = (Path("/run/gritd") / SOCKET, Path("runs") / SOCKET)
LONGEST = 107  # [bytes] of the path of a Unix socket
KERNEL_TABLE = Path("/proc/net/unix")
PATIENCE = 10.0  # [s] with a daemon, or a computer, that is held up
MAX_LINE = 1 << 20  # [bytes] of a report
NO_GRITD = "what answers on this socket is no gritd"

Report = dict[str, Any]


def add_socket(parser: Parser) -> None:
    """The option that says where the daemon is."""
    parser.add_argument(
        "--socket",
        metavar="PATH",
        help="the daemon's status socket (default: that of the daemon or demo that runs here)",
    )


def connected(given: str | None) -> socket.socket:
    """A connection to the daemon: the given one, else the one that runs on this computer. Raises
    CommandError.
    """
    if given:
        return _connected(Path(given))

    answering = [(path, connection) for path, connection in map(_tried, places()) if connection]
    if not answering:
        looked = ", ".join(map(str, PLACES))
        raise CommandError(f"no daemon answers: found none that listens, and no socket at {looked}")
    if len(answering) > 1:
        for _, connection in answering:
            connection.close()
        sockets = ", ".join(str(path) for path, _ in answering)
        raise CommandError(
            f"found {len(answering)} daemons; expected --socket with one of {sockets}"
        )
    return answering[0][1]


def places() -> list[Path]:
    """Where a daemon may listen: the usual places, and every socket of that name that some process
    of this computer has open.
    """
    sockets = {path.resolve(): path for path in (*PLACES, *_listening()) if path.exists()}
    return list(sockets.values())


def _listening() -> list[Path]:
    """Sockets of the daemon's name in the kernel's table. A path there is as it was bound; one
    that was bound relative to another folder than ours leads nowhere.
    """
    try:
        lines = KERNEL_TABLE.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
    return [Path(path) for line in lines if (path := line.split(" ")[-1]).endswith(f"/{SOCKET}")]


def _tried(path: Path) -> tuple[Path, socket.socket | None]:
    """A place with a connection to the daemon there; None where none answers."""
    try:
        return path, _connected(path)
    except CommandError:
        return path, None


def _connected(path: Path) -> socket.socket:
    """Raises CommandError."""
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

    if isinstance(report, dict) and isinstance(reason := report.get(REFUSED), str):
        raise CommandError(f"the daemon is busy: {visible(reason):.100}")
    if (
        not isinstance(report, dict)
        or not {"healthy", "status", "tick", "loop", "log", "devices"} <= report.keys()
    ):
        raise CommandError(NO_GRITD)
    return report


def in_lines(form: Callable[[Report], Iterator[str]], report: Report) -> list[str]:
    """A report in lines, whoever sent it. Raises CommandError where a field is missing."""
    try:
        return [visible(line) for line in form(report)]
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
        raise CommandError(NO_GRITD) from None
