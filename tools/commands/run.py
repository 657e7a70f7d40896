"""`gritd run`: the daemon on the configured devices."""

from __future__ import annotations

import os
import sys
import time
from argparse import Namespace
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from gritd.estimator.config.yamltree import Mapping, Scalar, compose, read_text
from gritd.estimator.daemon.lock import LockError, alone_at, locked
from gritd.estimator.daemon.notify import Notifier, extended
from gritd.estimator.daemon.starts import forget, wait_before
from gritd.tools.cli.command import DONE, FAILED, CommandError, Parser, file_name, number, whole
from gritd.tools.service.client import LONGEST, SOCKET
from gritd.tools.service.shown import shown

START = 30.0  # [s] that the manager gives a start, as in the unit

if TYPE_CHECKING:
    from gritd.estimator.config.configuration import Configuration
    from gritd.estimator.messages.run_info import RunInfo


def main(argv: Sequence[str]) -> int:
    """Exit 0 after SIGTERM or SIGINT with everything written; 1 if a thread died; 2 for the
    configuration.
    """
    parser = build_parser()
    arguments = parser.parse_args(argv)
    if arguments.fast and not arguments.from_tap:
        parser.error("argument --fast: only with --from-tap")

    runtime = os.environ.get("RUNTIME_DIRECTORY")
    if runtime:
        _wait(Path(runtime))

    try:
        with ExitStack() as held:
            code = _run(arguments, held)
        if runtime and code == DONE:
            forget(Path(runtime))
        return code
    except LockError as error:
        raise CommandError(error, FAILED) from None


def _wait(runtime: Path) -> None:
    """Under a service manager: not at once, where the daemon has ended again and again."""
    seconds = wait_before(runtime, time.monotonic())
    if seconds > 0.0:
        print(f"ended again and again: starts in {seconds:.0f} s", file=sys.stderr, flush=True)
        Notifier().tell(extended(seconds + START))
        time.sleep(seconds)


def _run(arguments: Namespace, held: ExitStack) -> int:
    """Lock the log folder and serve. A folder that is there is locked before the rest of the
    program is loaded, which takes half a second: whoever is refused need not wait for it.
    """
    named = _folder_named(arguments)
    early = named if named and named.is_dir() else None
    lock = held.enter_context(locked(early)) if early else None
    from gritd.estimator.config.configuration import load
    from gritd.tools.service.serve import Service, serve

    configuration = load(arguments.config)
    folder = Path(arguments.directory or configuration.settings.logging.directory)
    if lock is None or folder != early:
        lock = held.enter_context(locked(folder))

    run = _run_info(configuration.run, arguments)
    if arguments.fast:
        return _played(configuration, folder, run, arguments.from_tap)
    place = _socket_path(folder, arguments.socket)
    held.enter_context(alone_at(place))
    if arguments.view:
        held.enter_context(shown(place))
    service = Service(
        lock,
        run,
        place,
        arguments.status,
        arguments.tap,
        arguments.from_tap,
    )
    return serve(configuration, service)


def _played(configuration: Configuration, folder: Path, run: RunInfo, wires: Path) -> int:
    """A recording of wire logs that are played at once, and where it lies."""
    from gritd.estimator.daemon.clock import Clock
    from gritd.estimator.recording.mcapfile import RecordingError
    from gritd.estimator.recording.parts import run_path
    from gritd.tools.cli.files import unwritten
    from gritd.tools.service.tap import play_at_once

    path = run_path(folder, run.name, Clock().now())
    try:
        print(play_at_once(configuration, wires, run, path))
    except RecordingError as error:
        raise unwritten(error) from None
    print(f"log {path}")
    return DONE


def _folder_named(arguments: Namespace) -> Path | None:
    """Where logs go by the command line, or by the configuration as it is written; None where
    neither says so.
    """
    if arguments.directory:
        return Path(arguments.directory)
    tree = compose(read_text(Path(arguments.config)), arguments.config)
    logging = tree.items.get("logging") if isinstance(tree, Mapping) else None
    directory = logging.items.get("directory") if isinstance(logging, Mapping) else None
    return Path(directory.text) if isinstance(directory, Scalar) and directory.text else None


def _socket_path(folder: Path, given: str | None) -> Path:
    """The given path; under a service manager its runtime directory, otherwise beside the logs,
    with the whole path if a socket can have it: `gritd status` finds it from anywhere.
    """
    if given:
        return Path(given)
    path = Path(os.environ.get("RUNTIME_DIRECTORY", folder)) / SOCKET
    return path.absolute() if len(os.fsencode(path.absolute())) <= LONGEST else path


def _run_info(run: RunInfo, arguments: object) -> RunInfo:
    """The configuration's run section, with what the command line says instead."""
    given = {
        "name": getattr(arguments, "name", None),
        "nominal_load": getattr(arguments, "load", None),
        "pass_number": getattr(arguments, "passes", None),
        "start_position": getattr(arguments, "start", None),
        "operator": getattr(arguments, "operator", None),
        "notes": getattr(arguments, "notes", None),
    }
    return replace(run, **{key: value for key, value in given.items() if value is not None})


def build_parser() -> Parser:
    parser = Parser(
        prog="gritd run",
        description="Run the daemon until SIGTERM or Ctrl-C. SIGHUP reloads the configuration.",
    )
    parser.add_argument(
        "--config", required=True, metavar="F", help="configuration, see config/testbed.yaml"
    )
    parser.add_argument(
        "--directory", metavar="DIR", help="where logs go (default: logging.directory)"
    )
    parser.add_argument(
        "--socket", metavar="PATH", help=f"status socket (default: {SOCKET} beside the logs)"
    )

    parser.add_argument("--name", type=file_name, help="name of the run")
    parser.add_argument(
        "--load", type=number(above=0.0), metavar="N", help="nominal load of the run [N]"
    )
    parser.add_argument(
        "--pass",
        dest="passes",
        type=whole(1, 1000),
        metavar="K",
        help="how often the wheel went here, this run included",
    )
    parser.add_argument(
        "--start", type=number(), metavar="M", help="starting position on the bed [m]"
    )
    parser.add_argument("--operator", help="who runs it; the report names them")
    parser.add_argument("--notes", help="free text kept with the run, for the report")
    parser.add_argument(
        "--status",
        type=number(low=0.0),
        default=1.0,
        metavar="S",
        help="seconds between status lines, 0 for none",
    )

    parser.add_argument("--view", action="store_true", help="show it in a browser meanwhile")

    wires = parser.add_mutually_exclusive_group()
    wires.add_argument(
        "--tap", type=Path, metavar="DIR", help="keep the raw bytes of every device in this folder"
    )
    wires.add_argument(
        "--from-tap",
        type=Path,
        metavar="DIR",
        help="play such a folder through the drivers in place of the devices, then end",
    )
    parser.add_argument(
        "--fast",
        action="store_true",
        help="with --from-tap: at once, not in real time, with the recorded times",
    )

    return parser
