"""The daemon: readers, loop and writer as threads of one process, started, watched and stopped in
order.

Readers are handed in (they come from `drivers`, which the estimator does not know). If a thread
dies the daemon stops with a named reason and a closed log, so that the service manager starts it
anew; it never runs on without a thread. If one hangs, `health` names it and the watchdog is no
longer stroked.
"""

from __future__ import annotations

import gc
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from threading import Event, Thread
from typing import Protocol

from gritd.estimator.config.configuration import Configuration
from gritd.estimator.daemon.clock import Clock
from gritd.estimator.daemon.disagreement import Watch
from gritd.estimator.daemon.ending import Ending
from gritd.estimator.daemon.health import Pulse, silent
from gritd.estimator.daemon.loop import Change, Loop, LoopRecord, Source
from gritd.estimator.messages.readings import Reading
from gritd.estimator.messages.record import LOOP_FIELDS, TICK_FIELDS
from gritd.estimator.offline.playback import CHECKPOINT, settings_for
from gritd.estimator.online.carry import needs_restart
from gritd.estimator.online.pipeline import Pipeline, TickRecord
from gritd.estimator.recording.cdr import STRING, TIME, Topic
from gritd.estimator.recording.patience import waited
from gritd.estimator.recording.run import LOG_TOPIC, RunInfo
from gritd.estimator.recording.writer import WriterStatus, WriterThread

TICK_TOPIC = Topic("/tick", "gritd_msgs/msg/Tick", TICK_FIELDS)
LOOP_TOPIC = Topic("/loop", "gritd_msgs/msg/Loop", LOOP_FIELDS)
CHECKPOINT_TOPIC = Topic(
    CHECKPOINT,
    "gritd_msgs/msg/Checkpoint",
    (
        ("stamp", TIME, "time of the tick before"),
        ("configuration", STRING, "effective YAML from here on"),
        ("state", STRING, "what the next tick begins with: estimator/online/checkpoint.py"),
    ),
)
TOPICS = (TICK_TOPIC, LOOP_TOPIC, CHECKPOINT_TOPIC)

SWITCH_INTERVAL = 0.0005  # [s] how soon the loop gets the interpreter back from another thread
KEPT_TUPLES, LONGEST_KEPT = (
    2000,
    20,
)  # freed tuples of each length up to this are kept by CPython (tupleobject.h)
PRIORITY = 20  # SCHED_FIFO, for all threads: for the loop alone it would starve the readers
WATCH = 0.1  # [s] between looks at the threads
INFO, WARNING, ERROR = 20, 30, 40  # levels of /log
# [s] for everything to end: half of it for the readers, a quarter for the loop; Python takes 0.2 s
# more
STOP = 1.5
MIN_PART = 1.0  # [s] a part is at least this long
MAX_CHUNKS = 400_000  # and of no more flushes than this: a reader takes 500,000
WALL_STEP = 0.05  # [s] a jump of the wall clock worth a line in the log

# Looks (of WATCH) without a sign of life before a thread is said to hang.
LOOP_PATIENCE = 10
READER_PATIENCE = 80  # between two attempts to open a port it waits 5 s
WRITER_PATIENCE = 100  # a disk may be slow: the queue holds 40 s


class DaemonError(Exception):
    """The daemon cannot start or cannot go on: one line."""


class ReaderThread(Protocol):
    """What the daemon needs of a reader."""

    device: str
    beats: int  # moves while the thread is not held up

    @property
    def alive(self) -> bool: ...

    def start(self) -> None: ...

    def stop(self, timeout: float) -> bool: ...


class LogSink:
    """Hands ticks to the writer thread, readings first: file order is consumption order."""

    def __init__(self, writer: WriterThread) -> None:
        self._writer = writer

    def put(self, readings: Sequence[Reading], tick: TickRecord, loop: LoopRecord) -> None:
        stamp = loop.stamp
        self._writer.put(readings, [(TICK_TOPIC.name, stamp, tick), (LOOP_TOPIC.name, stamp, loop)])

    def counts(self) -> tuple[int, int]:
        status = self._writer.status()
        return status.queued, status.dropped

    def checkpoint(self, stamp: int, configuration: str, state: str, new_part: bool) -> None:
        message = (CHECKPOINT_TOPIC.name, stamp, (stamp, configuration, state))
        if new_part:
            self._writer.begin_part(configuration, message)
        else:
            self._writer.put((), [message])


class Daemon:
    """One run. `serve` blocks until `stop` is set or something dies; it returns the writer's last
    word.

    Raises DaemonError, and what WriterThread raises if the first file cannot be created.
    """

    def __init__(
        self,
        configuration: Configuration,
        path: Path,
        run: RunInfo,
        readers: Sequence[ReaderThread],
        source: Source,
        clock: Clock,
    ) -> None:
        self.configuration = configuration
        self.run = run
        self.readers = readers
        self.clock = clock
        self.writer = _writer(path, configuration, run)
        pipeline = Pipeline(settings_for(configuration.settings, run))
        self.loop = Loop(pipeline, source, LogSink(self.writer), clock, configuration.text)
        self._pulses = [
            Pulse("loop", lambda: self.loop.ticks, LOOP_PATIENCE),
            Pulse("writer", lambda: self.writer.beats, WRITER_PATIENCE),
            *(
                Pulse(f"reader {reader.device}", partial(_beats, reader), READER_PATIENCE)
                for reader in readers
            ),
        ]
        self.model = Watch()  # whether model and measurement agree
        self.health = ""  # the threads that hang; stroke the watchdog only while there are none
        self.deleted: list[
            Path
        ] = []  # parts that somebody deleted while they were written, not yet told
        self._part_began = time.monotonic()
        self._ending_part: Path | None = None  # which the writer was asked to end
        self._ending, self._loop_stop = Ending(), Event()
        self._failure = ""
        self._wall_offset = 0.0

    def stop(self) -> None:
        """Ask `serve` to end; may be called from a signal handler."""
        self._ending.set()

    def say(self, level: int, text: str) -> None:
        """A line into the recording's /log."""
        now = self.clock.now()
        self.writer.put((), [(LOG_TOPIC.name, now, (now, level, "gritd", text, "", "", 0))])

    def change_to(self, configuration: Configuration) -> Change | None:
        """What goes on with another configuration, made ready; None where it is the same. It may
        take a second.

        Raises DaemonError where that needs a restart.
        """
        if configuration.text == self.configuration.text:
            return None
        fixed = needs_restart(self.configuration.settings, configuration.settings)
        if fixed:
            raise DaemonError(f"{configuration.source}: {fixed}: changed, which needs a restart")
        return Change(configuration.text, Pipeline(settings_for(configuration.settings, self.run)))

    def reload(self, configuration: Configuration, change: Change) -> None:
        """Go on with it from the next tick, in a new part of the recording."""
        self.loop.ask(change)
        self.configuration = configuration
        self._part_began = time.monotonic()

    def serve(self, watch: Callable[[Daemon], None] = lambda daemon: None) -> WriterStatus:
        """Run until stopped. `watch` is called about ten times a second from the caller's thread."""
        self.writer.start()
        for reader in self.readers:
            reader.start()
        loop = Thread(target=self._run_loop, name="loop", daemon=True)
        with _undisturbed():
            loop.start()
            while not self._ending.wait(WATCH):
                self._look(loop, watch)
            left = self._drained(loop)
        return self._close(left)

    def _drained(self, loop: Thread) -> float:
        """End the readers, then the loop, which takes what they left; what remains of STOP for the
        writer [s].
        """
        for reader in self.readers:
            reader.stop(0.0)
        left = STOP / 2 + waited(lambda: not any(reader.alive for reader in self.readers), STOP / 2)
        self._loop_stop.set()
        return left / 2 + waited(lambda: not loop.is_alive(), left / 2)

    def fail(self, reason: str) -> None:
        """Stop, with a reason; the first one given is the one told."""
        self._failure = self._failure or reason
        self._ending.set()

    def _look(self, loop: Thread, watch: Callable[[Daemon], None]) -> None:
        try:
            self._check(loop)
            self._compare()
            self._rotate()
            watch(self)
        except Exception as error:  # a fault of ours: named, and the log is closed all the same
            self.fail(f"the watch failed: {type(error).__name__}: {error}")

    def _run_loop(self) -> None:
        try:
            self.loop.run(self._loop_stop)
        except (
            Exception
        ) as error:  # named, and the daemon stops: a dead loop must not look like a quiet one
            self.fail(f"the loop failed: {type(error).__name__}: {error}")

    def _check(self, loop: Thread) -> None:
        """Stop with a reason if a thread died; note one that hangs, and a step of the wall clock."""
        dead = [f"reader {reader.device}" for reader in self.readers if not reader.alive]
        dead += [] if self.writer.alive else ["writer"]
        dead += [] if loop.is_alive() else ["loop"]
        if dead:
            self.fail(f"thread died: {', '.join(dead)}")
        self.health = silent(self._pulses)
        offset = self.clock.wall_offset()
        if abs(offset - self._wall_offset) > WALL_STEP:
            self.say(
                WARNING,
                f"wall clock stepped by {offset - self._wall_offset:+.3f} s; stamps keep the old one",
            )
            self._wall_offset = offset

    def _compare(self) -> None:
        """Say where model and measurement begin or cease to disagree."""
        if self.loop.latest is not None and (said := self.model.look(self.loop.latest[0])):
            self.say(WARNING if self.model.present else INFO, said)

    def _rotate(self) -> None:
        """Ask for a new part when the present one is large or old, or gone."""
        logging, age = self.configuration.settings.logging, time.monotonic() - self._part_began
        status = self.writer.status()
        part = status.files[-1]
        if age < MIN_PART or status.state != "writing" or part == self._ending_part:
            return
        size, longest = _size(part), min(logging.part_time, MAX_CHUNKS * logging.flush_interval)
        if size is None:
            self.deleted.append(part)
        if size is None or size > min(logging.part_size, logging.disk_cap / 2.0) or age > longest:
            self.loop.ask(Change(self.configuration.text))
            self._part_began, self._ending_part = time.monotonic(), part

    def _close(self, patience: float) -> WriterStatus:
        if self._failure:
            self.say(ERROR, self._failure)
        status = self.writer.stop(patience)
        if self._failure:
            raise DaemonError(self._failure)
        return status


def _writer(path: Path, configuration: Configuration, run: RunInfo) -> WriterThread:
    logging = configuration.settings.logging
    return WriterThread(
        path,
        TOPICS,
        configuration.text,
        run,
        compression=logging.compression,
        flush_interval=logging.flush_interval,
    )


def _beats(reader: ReaderThread) -> int:
    return reader.beats


def _size(path: Path) -> int | None:
    """None where nothing is."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return None
    except OSError:
        return 0


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Short switch interval, no garbage collection of what was built at start, and memory as it
    will be for good.
    """
    interval = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL)
    gc.collect()
    gc.freeze()
    _fill_free_lists()
    try:
        yield
    finally:
        gc.unfreeze()
        sys.setswitchinterval(interval)


def _fill_free_lists() -> None:
    """What CPython keeps of freed tuples, it keeps from the start: else it comes by and by, 0.4 MB
    when a path through the code is first taken, and looks like a leak for hours.
    """
    for length in range(1, LONGEST_KEPT + 1):
        kept = [tuple(range(length)) for _ in range(KEPT_TUPLES)]
        del kept


def real_time() -> str:
    """Real-time scheduling for this thread and those it starts; '' or one line why not."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        return ""
    except (OSError, AttributeError) as error:
        return f"no real-time scheduling ({getattr(error, 'strerror', None) or error}): ticks may be late under load"


def run_path(folder: Path, name: str, started: int) -> Path:
    """RUN-YYYYmmdd-HHMMSS.mcap, in UTC, not yet taken."""
    stem = f"{name or 'run'}-{time.strftime('%Y%m%d-%H%M%S', time.gmtime(started / 1e9))}"
    paths = (folder / f"{stem}{suffix}.mcap" for suffix in ("", *(f"-{n}" for n in range(2, 1000))))
    return next(path for path in paths if not path.exists())
