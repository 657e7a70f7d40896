"""`gritd run`: the daemon on the configured devices."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence
from dataclasses import replace
from math import degrees
from pathlib import Path

from drivers.build import build_readers
from drivers.queue import ReadingQueue
from drivers.reader import Reader, ReaderStats
from estimator.clock import Clock
from estimator.config import Configuration, load
from estimator.daemon import INFO, WARNING, Daemon, DaemonError, locked, real_time, run_path
from estimator.record import TICK_NAMES, Flag, Status
from estimator.recording import RecordingError, RunInfo
from estimator.writer import WriterStatus
from tools.command import DONE, FAILED, CommandError, Parser


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
            return _serve(configuration, folder, run, arguments.status)
    except (DaemonError, RecordingError) as error:
        raise CommandError(error, FAILED) from None


def _serve(configuration: Configuration, folder: Path, run: RunInfo, status_every: float) -> int:
    clock, queue = Clock(), ReadingQueue()
    notice = real_time()
    readers = build_readers(configuration.settings, clock.now, queue)
    path = run_path(folder, run.name, clock.now())
    daemon = Daemon(configuration, path, run, readers, QueueSource(queue), clock)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: daemon.stop())
    print(f"logging to {path}", flush=True)
    if notice:
        print(notice, file=sys.stderr, flush=True)
        daemon.say(WARNING, notice)
    watcher = Watcher(readers, queue, status_every)
    last = daemon.serve(watcher)
    watcher.report(daemon)
    print(closing_line(last), flush=True)
    return DONE if last.state == "closed" else FAILED


class Watcher:
    """Prints a line of status now and then, and every change of a device's state at once."""

    def __init__(self, readers: Sequence[Reader], queue: ReadingQueue, every: float) -> None:
        self._readers, self._queue, self._every = readers, queue, every
        self._states = {reader.device: "" for reader in readers}
        self._writing = "writing"
        self._calls = 0

    def __call__(self, daemon: Daemon) -> None:
        for reader in self._readers:
            self._follow(daemon, reader.stats())
        status = daemon.writer.status()
        if status.state != self._writing:
            self._writing = status.state
            self._tell(daemon, WARNING if status.state == "degraded" else INFO, f"log {status.state} {status.error}")
        self._calls += 1
        if self._every > 0 and self._calls % round(self._every * 10) == 0:
            print(status_line(daemon), flush=True)

    def _follow(self, daemon: Daemon, stats: ReaderStats) -> None:
        if stats.state == self._states[stats.device]:
            return
        self._states[stats.device] = stats.state
        trouble = stats.state not in ("OPEN", "ENDED")
        self._tell(daemon, WARNING if trouble else INFO, f"device {stats.device} {stats.state} {stats.last_error}")

    @staticmethod
    def _tell(daemon: Daemon, level: int, text: str) -> None:
        print(text.strip(), file=sys.stderr if level > INFO else sys.stdout, flush=True)
        daemon.say(level, text.strip())

    def report(self, daemon: Daemon) -> None:
        """Every counter, once, at the end."""
        counts = self._queue.counts()
        print(
            f"queue: received {counts.received} = processed {counts.processed} + dropped {counts.dropped}"
            f" + queued {counts.queued}"
        )
        for reader in self._readers:
            s = reader.stats()
            print(
                f"device {s.device}: {s.readings} readings, {s.frames} frames, {s.bad} bad, {s.garbage} garbage bytes,"
                f" {s.lost} lost, {s.duplicates} duplicates, {s.quarantined} quarantined, {s.incomplete} incomplete,"
                f" {s.unknown} unknown, {s.errors} bus errors, reopened {s.reopened} times"
            )
        print(f"loop: {daemon.loop.ticks} ticks, {daemon.loop.missed} missed")


def status_line(daemon: Daemon) -> str:
    """The latest tick in one line."""
    if daemon.loop.latest is None:
        return "no tick yet"
    tick, loop = daemon.loop.latest
    t = dict(zip(TICK_NAMES, tick, strict=True))
    line = (
        f"{Status(int(t['status'])).name:10} slip {t['slip']:6.1%}  z {t['sinkage'] * 1e3:5.1f} mm"
        f"  θ₁ {degrees(t['theta_1']):4.1f}°  W {t['load']:5.1f} N  T {t['torque']:5.2f} N·m"
        f"  c {t['cohesion']:6.0f} ± {t['cohesion_sigma']:4.0f} Pa  tan φ {t['tan_phi']:.3f} ± {t['tan_phi_sigma']:.3f}"
        f"  late {loop.lateness * 1e3:.2f} ms"
    )
    flags = [flag.name or "" for flag in Flag if flag and int(t["flags"]) & flag]
    return f"{line}  {' '.join(flags)}".rstrip()


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
    parser = Parser(prog="gritd run", description="Run the daemon until SIGTERM or Ctrl-C.")
    parser.add_argument("--config", required=True, metavar="F", help="configuration, see config/testbed.yaml")
    parser.add_argument("--directory", metavar="DIR", help="where logs go (default: logging.directory)")
    parser.add_argument("--name", help="name of the run")
    parser.add_argument("--load", type=float, metavar="N", help="nominal load of the run [N]")
    parser.add_argument(
        "--pass", dest="passes", type=int, metavar="K", help="how often the wheel went here, this run included"
    )
    parser.add_argument("--start", type=float, metavar="M", help="starting position on the bed [m]")
    parser.add_argument("--notes", help="free text kept with the run")
    parser.add_argument(
        "--status", type=float, default=1.0, metavar="S", help="seconds between status lines, 0 for none"
    )
    return parser
