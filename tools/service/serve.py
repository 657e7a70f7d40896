"""The daemon of `gritd run` on the configured devices, from its first thread to its last word."""

from __future__ import annotations

import logging
import signal
import sys
import threading
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from gritd.drivers.build import build_readers, check_free
from gritd.drivers.queue import ReadingQueue
from gritd.drivers.recorded import Playback
from gritd.estimator.config.configuration import Configuration
from gritd.estimator.daemon.bed_file import BedError
from gritd.estimator.daemon.clock import Clock
from gritd.estimator.daemon.daemon import INFO, WARNING, Daemon, DaemonError
from gritd.estimator.daemon.lock import FolderLock
from gritd.estimator.daemon.publish import Publisher, PublishError
from gritd.estimator.daemon.scheduling import real_time
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.parts import run_path
from gritd.estimator.recording.retention import sweep
from gritd.estimator.recording.writer import WriterStatus
from gritd.tools.cli.command import DONE, FAILED, CommandError
from gritd.tools.cli.files import open_to_all
from gritd.tools.service.bed_keeper import bed_of_run
from gritd.tools.service.journal import say, tell
from gritd.tools.service.tap import Taps, playback_of
from gritd.tools.service.telemetry import Reporter
from gritd.tools.service.watcher import Watcher


class QueueSource:
    """The reading queue as the loop sees it."""

    def __init__(self, queue: ReadingQueue) -> None:
        self._queue = queue
        self.drain = queue.drain

    def dropped(self) -> int:
        return self._queue.counts().dropped


@dataclass(frozen=True)
class Service:
    """What `gritd run` is given besides the configuration."""

    lock: FolderLock  # of the logs
    run: RunInfo
    socket: Path
    status_every: float  # [s], 0 for never
    tap: Path | None = None  # folder to keep the raw bytes of every device in
    from_tap: Path | None = None  # folder of such bytes, in the place of the devices

    @property
    def folder(self) -> Path:
        """Of the logs."""
        return self.lock.folder


def serve(configuration: Configuration, service: Service) -> int:
    """Run until told to stop, or until what is played is over; the exit code. Raises CommandError
    if it cannot start or a thread dies.
    """
    try:
        return _serve(configuration, service)
    except (BedError, DaemonError, RecordingError, PublishError) as error:
        raise CommandError(error, FAILED) from None


def _serve(configuration: Configuration, service: Service) -> int:
    settings = configuration.settings
    clock, queue, notice = Clock(), ReadingQueue(), real_time()
    taps = Taps(service.tap, settings) if service.tap else None
    playback = playback_of(service.from_tap, settings, clock.now) if service.from_tap else None
    tap_of = taps.writers.__getitem__ if taps else _no_tap
    if playback is None:
        check_free(settings)
    readers = build_readers(settings, clock.now, queue, tap_of, playback)

    for rescued in sweep(service.folder):
        say(f"{rescued}: a power cut had taken its name; it has it again")

    path = run_path(service.folder, service.run.name, clock.now())
    bed = bed_of_run(service.folder, settings, service.run)
    run, start = (bed.named(service.run), bed.start) if bed else (service.run, None)
    daemon = Daemon(configuration, path, run, readers, QueueSource(queue), clock, start)
    publisher = Publisher(service.socket, Reporter(daemon, readers, queue, notice))
    watcher = Watcher(
        configuration.source, readers, queue, publisher, service.lock, service.status_every
    )

    _listen_to_signals(daemon, watcher)
    _announce(daemon, path, notice)
    if bed:
        tell(daemon, INFO, bed.announced())
    with closing(publisher):
        publisher.start()
        last = daemon.serve(lambda daemon: _watch(daemon, watcher, taps, playback))

    watcher.report(daemon)
    if bed:
        say(bed.closed(daemon))
    if taps:
        say(taps.close())
    say(closing_line(last))
    return DONE if last.state == "closed" else FAILED


def _no_tap(device: str) -> None:
    """Nothing is kept of a device."""


def _listen_to_signals(daemon: Daemon, watcher: Watcher) -> None:
    for stop in (signal.SIGTERM, signal.SIGINT):
        signal.signal(stop, lambda *_: daemon.stop())
    signal.signal(signal.SIGHUP, lambda *_: watcher.ask_reload())

    threading.excepthook = _say_in_a_line
    logging.getLogger("can").setLevel(logging.CRITICAL)  # a reader says the same, once


def _announce(daemon: Daemon, path: Path, notice: str) -> None:
    """Where the log is, and what may be amiss from the start."""
    say(f"logging to {path}")
    configuration = daemon.configuration
    readable = open_to_all(Path(configuration.source), configuration.settings)
    for warning in filter(None, (daemon.clock.notice, notice, *readable)):
        say(warning, sys.stderr)
        daemon.say(WARNING, warning)


def _watch(daemon: Daemon, watcher: Watcher, taps: Taps | None, playback: Playback | None) -> None:
    """Ten times a second: what the watcher does, wire logs that were given up, the end of what is
    played.
    """
    watcher(daemon)
    for line in taps.trouble() if taps else ():
        tell(daemon, WARNING, line)
    if playback and playback.over:
        daemon.stop()


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
