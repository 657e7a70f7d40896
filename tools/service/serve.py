"""The daemon of `gritd run` on the configured devices, from its first thread to its last word."""

from __future__ import annotations

import logging
import signal
import sys
import threading
from contextlib import closing
from pathlib import Path

from gritd.drivers.build import build_readers
from gritd.drivers.queue import ReadingQueue
from gritd.estimator.config.configuration import Configuration
from gritd.estimator.daemon.clock import Clock
from gritd.estimator.daemon.daemon import WARNING, Daemon, DaemonError
from gritd.estimator.daemon.publish import Publisher, PublishError
from gritd.estimator.daemon.scheduling import real_time
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.parts import run_path
from gritd.estimator.recording.retention import sweep
from gritd.estimator.recording.writer import WriterStatus
from gritd.tools.cli.command import DONE, FAILED, CommandError
from gritd.tools.cli.files import open_to_all
from gritd.tools.service.telemetry import Reporter
from gritd.tools.service.watcher import Watcher, say


class QueueSource:
    """The reading queue as the loop sees it."""

    def __init__(self, queue: ReadingQueue) -> None:
        self._queue = queue
        self.drain = queue.drain

    def dropped(self) -> int:
        return self._queue.counts().dropped


def serve(
    configuration: Configuration, folder: Path, run: RunInfo, socket: Path, status_every: float
) -> int:
    """Run until told to stop; the exit code. Raises CommandError if it cannot start or a thread
    dies.
    """
    try:
        return _serve(configuration, folder, run, socket, status_every)
    except (DaemonError, RecordingError, PublishError) as error:
        raise CommandError(error, FAILED) from None


def _serve(
    configuration: Configuration, folder: Path, run: RunInfo, socket: Path, status_every: float
) -> int:
    clock, queue = Clock(), ReadingQueue()
    notice = real_time()
    readers = build_readers(configuration.settings, clock.now, queue)

    for found in sweep(folder):
        say(f"{found}: a power cut had taken its name; it has it again")

    path = run_path(folder, run.name, clock.now())
    daemon = Daemon(configuration, path, run, readers, QueueSource(queue), clock)
    publisher = Publisher(socket, Reporter(daemon, readers, queue, notice))
    watcher = Watcher(configuration.source, readers, queue, publisher, status_every)

    for ending in (signal.SIGTERM, signal.SIGINT):
        signal.signal(ending, lambda *_: daemon.stop())
    signal.signal(signal.SIGHUP, lambda *_: watcher.ask_reload())

    say(f"logging to {path}")
    for warning in filter(None, (notice, open_to_all(Path(configuration.source)))):
        say(warning, sys.stderr)
        daemon.say(WARNING, warning)

    threading.excepthook = _say_in_a_line
    logging.getLogger("can").setLevel(logging.CRITICAL)  # a reader says the same, once

    with closing(publisher):
        publisher.start()
        last = daemon.serve(watcher)

    watcher.report(daemon)
    say(closing_line(last))
    return DONE if last.state == "closed" else FAILED


def _say_in_a_line(died: threading.ExceptHookArgs) -> None:
    """What kills a thread, without a traceback; the daemon notices and ends with a reason."""
    name = died.thread.name if died.thread else "a thread"
    say(f"{name}: {died.exc_type.__name__}: {died.exc_value}", sys.stderr)


def closing_line(status: WriterStatus) -> str:
    files = ", ".join(map(str, status.files))
    line = (
        f"log {status.state}: accepted {status.accepted} = written {status.written} + dropped "
        f"{status.dropped} + queued {status.queued}; {files}"
    )
    return f"{line}; {status.error}" if status.error else line
