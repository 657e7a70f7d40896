"""`gritd run`: the daemon on the configured devices."""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from drivers.build import build_readers
from drivers.queue import ReadingQueue
from estimator.config import Configuration, load
from estimator.daemon import WARNING, Daemon, DaemonError, locked, real_time, run_path
from estimator.daemon.clock import Clock
from estimator.daemon.publish import Publisher, PublishError
from estimator.recording import RecordingError, RunInfo
from estimator.recording.writer import WriterStatus
from tools.command import DONE, FAILED, CommandError, Parser, number, whole
from tools.telemetry import Reporter
from tools.watcher import Watcher

SOCKET = "gritd.sock"


class QueueSource:
    """The reading queue as the loop sees it."""

    def __init__(self, queue: ReadingQueue) -> None:
        self._queue = queue
        self.drain = queue.drain

    def dropped(self) -> int:
        return self._queue.counts().dropped


def main(argv: Sequence[str]) -> int:
    """Exit 0 after SIGTERM or SIGINT with everything written; 1 if a thread died; 2 for the configuration."""
    arguments = _parser().parse_args(argv)
    configuration = load(arguments.config)
    run = _run_info(configuration.run, arguments)
    folder = Path(arguments.directory or configuration.settings.logging.directory)
    try:
        with locked(folder):
            return _serve(configuration, folder, run, _socket_path(folder, arguments.socket), arguments.status)
    except (DaemonError, RecordingError, PublishError) as error:
        raise CommandError(error, FAILED) from None


def _serve(configuration: Configuration, folder: Path, run: RunInfo, socket: Path, status_every: float) -> int:
    clock, queue = Clock(), ReadingQueue()
    notice = real_time()
    readers = build_readers(configuration.settings, clock.now, queue)
    path = run_path(folder, run.name, clock.now())
    daemon = Daemon(configuration, path, run, readers, QueueSource(queue), clock)
    publisher = Publisher(socket, Reporter(daemon, readers, queue, notice))
    watcher = Watcher(configuration.source, readers, queue, publisher, status_every)
    for ending in (signal.SIGTERM, signal.SIGINT):
        signal.signal(ending, lambda *_: daemon.stop())
    signal.signal(signal.SIGHUP, lambda *_: watcher.ask_reload())
    print(f"logging to {path}", flush=True)
    if notice:
        print(notice, file=sys.stderr, flush=True)
        daemon.say(WARNING, notice)
    threading.excepthook = _say_in_a_line
    logging.getLogger("can").setLevel(logging.CRITICAL)  # a reader says the same, once
    with closing(publisher):
        publisher.start()
        last = daemon.serve(watcher)
    watcher.report(daemon)
    print(closing_line(last), flush=True)
    return DONE if last.state == "closed" else FAILED


def _say_in_a_line(died: threading.ExceptHookArgs) -> None:
    """What kills a thread, without a traceback; the daemon notices and ends with a reason."""
    name = died.thread.name if died.thread else "a thread"
    print(f"{name}: {died.exc_type.__name__}: {died.exc_value}", file=sys.stderr, flush=True)


def _socket_path(folder: Path, given: str | None) -> Path:
    """The given path; under a service manager its runtime directory, otherwise beside the logs."""
    return Path(given) if given else Path(os.environ.get("RUNTIME_DIRECTORY", folder)) / SOCKET


def closing_line(status: WriterStatus) -> str:
    files = ", ".join(map(str, status.files))
    line = (
        f"log {status.state}: accepted {status.accepted} = written {status.written} + dropped {status.dropped}"
        f" + queued {status.queued}; {files}"
    )
    return f"{line}; {status.error}" if status.error else line


def _run_info(run: RunInfo, arguments: object) -> RunInfo:
    """The configuration's run section, with what the command line says instead."""
    given = {
        "name": getattr(arguments, "name", None),
        "nominal_load": getattr(arguments, "load", None),
        "pass_number": getattr(arguments, "passes", None),
        "start_position": getattr(arguments, "start", None),
        "notes": getattr(arguments, "notes", None),
    }
    return replace(run, **{key: value for key, value in given.items() if value is not None})


def _parser() -> Parser:
    parser = Parser(
        prog="gritd run",
        description="Run the daemon until SIGTERM or Ctrl-C; SIGHUP reads calibration, noise and soil again.",
    )
    parser.add_argument("--config", required=True, metavar="F", help="configuration, see config/testbed.yaml")
    parser.add_argument("--directory", metavar="DIR", help="where logs go (default: logging.directory)")
    parser.add_argument("--socket", metavar="PATH", help=f"status socket (default: {SOCKET} beside the logs)")
    parser.add_argument("--name", help="name of the run")
    parser.add_argument("--load", type=number(above=0.0), metavar="N", help="nominal load of the run [N]")
    parser.add_argument(
        "--pass",
        dest="passes",
        type=whole(1, 1000),
        metavar="K",
        help="how often the wheel went here, this run included",
    )
    parser.add_argument("--start", type=number(), metavar="M", help="starting position on the bed [m]")
    parser.add_argument("--notes", help="free text kept with the run")
    parser.add_argument(
        "--status", type=number(low=0.0), default=1.0, metavar="S", help="seconds between status lines, 0 for none"
    )
    return parser
