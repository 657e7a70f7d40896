"""The daemon: readers, loop and writer as threads of one process, started, watched and stopped
in order.

Readers are handed in (they come from `drivers`, which the estimator does not know). If a thread
dies the daemon stops with a named reason and a closed log, so that the service manager starts it
anew; it never runs on without a thread. If one hangs, `health` names it and the watchdog is no
longer stroked.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from threading import Event, Thread
from typing import Protocol

from gritd.estimator.config.configuration import Configuration
from gritd.estimator.config.settings import settings_of_run
from gritd.estimator.daemon.clock import Clock
from gritd.estimator.daemon.disagreement import Watch
from gritd.estimator.daemon.feed import Feed
from gritd.estimator.daemon.log_sink import LogSink
from gritd.estimator.daemon.loop import Change, Loop, ReadingSource
from gritd.estimator.daemon.rotation import Rotation
from gritd.estimator.daemon.scheduling import first, on_one_core, undisturbed
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.online.bed import RunStart
from gritd.estimator.online.carry import needs_restart
from gritd.estimator.online.pipeline import Pipeline
from gritd.estimator.recording.topics import LOG_TOPIC, TOPICS
from gritd.estimator.recording.writer import WriterStatus, WriterThread
from gritd.estimator.threads.pulse import Pulse, silent
from gritd.estimator.threads.stop_request import StopRequest
from gritd.estimator.threads.waiting import wait_until

WATCH = 0.1  # [s] between looks at the threads
INFO, WARNING, ERROR = 20, 30, 40  # levels of /log
# [s] for everything to end: half of it for the readers, a quarter for the loop; Python takes 0.2
# s
# more
STOP = 1.5
MODES = {"owner": 0o600, "group": 0o640}  # of a recording, by logging.readable_by
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
    def inside(self) -> str: ...

    @property
    def alive(self) -> bool: ...

    def start(self) -> None: ...

    def stop(self, timeout: float) -> bool: ...


class Daemon:
    """One run. `serve` blocks until `stop` is set or something dies; it returns the writer's
    last word.

    Raises DaemonError, and what WriterThread raises if the first file cannot be created.
    """

    def __init__(
        self,
        configuration: Configuration,
        path: Path,
        run: RunInfo,
        readers: Sequence[ReaderThread],
        source: ReadingSource,
        clock: Clock,
        start: RunStart | None = None,
    ) -> None:
        """start: what the run begins with in the place of the stated prior."""
        self.configuration = configuration
        self.run = run
        self.readers = readers
        self.clock = clock

        self.writer = _writer(path, configuration, run)
        pipeline = Pipeline(settings_of_run(configuration.settings, run))
        sink = LogSink(self.writer)
        self.loop = Loop(pipeline, source, sink, clock, configuration.text, start)

        self._pulses = [
            Pulse("loop", lambda: self.loop.ticks, LOOP_PATIENCE),
            Pulse("writer", lambda: self.writer.beats, WRITER_PATIENCE),
            *(
                Pulse(
                    f"reader {reader.device}",
                    partial(_beats, reader),
                    READER_PATIENCE,
                    partial(_inside, reader),
                )
                for reader in readers
            ),
        ]

        self.model = Watch()  # whether model and measurement agree
        self.feed = Feed()  # whether the filter gets what it needs
        self.health = ""  # the threads that hang; stroke the watchdog only while there are none
        self.rotation = Rotation()
        self._stop, self._loop_stop = StopRequest(), Event()
        self._failure = ""
        self._wall_offset = clock.wall_offset()

    def stop(self) -> None:
        """Ask `serve` to end; may be called from a signal handler."""
        self._stop.set()

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

        return Change(
            configuration.text, Pipeline(settings_of_run(configuration.settings, self.run))
        )

    def reload(self, configuration: Configuration, change: Change) -> None:
        """Go on with it from the next tick, in a new part of the recording."""
        self.loop.ask(change)
        self.configuration = configuration
        self.rotation.begin()

    def serve(self, watch: Callable[[Daemon], None] = lambda daemon: None) -> WriterStatus:
        """Run until stopped. `watch` is called about ten times a second from the caller's
        thread.
        """
        self.writer.start()
        loop = Thread(target=self._run_loop, name="loop", daemon=True)

        with undisturbed():
            with on_one_core():
                for reader in self.readers:
                    reader.start()
                loop.start()
            while not self._stop.wait(WATCH):
                self._look(loop, watch)
            left = self._drain(loop)

        return self._close(left)

    def _drain(self, loop: Thread) -> float:
        """End the readers, then the loop, which takes what they left; what remains of STOP for
        the writer [s].
        """
        for reader in self.readers:
            reader.stop(0.0)
        left = STOP / 2 + wait_until(
            lambda: not any(reader.alive for reader in self.readers), STOP / 2
        )
        self._loop_stop.set()
        return left / 2 + wait_until(lambda: not loop.is_alive(), left / 2)

    def fail(self, reason: str) -> None:
        """Stop, with a reason; the first one given is reported."""
        self._failure = self._failure or reason
        self._stop.set()

    def _look(self, loop: Thread, watch: Callable[[Daemon], None]) -> None:
        try:
            self._check(loop)
            if self.rotation.due(self.configuration.settings.logging, self.writer.status()):
                self.loop.ask(Change(self.configuration.text))
            watch(self)
        except Exception as error:  # a fault of ours: named, and the log is closed all the same
            self.fail(f"the watch failed: {type(error).__name__}: {error}")

    def _run_loop(self) -> None:
        first()
        try:
            self.loop.run(self._loop_stop)
        # named, and the daemon stops: a dead loop must not look like a quiet one
        except Exception as error:
            self.fail(f"the loop failed: {type(error).__name__}: {error}")

    def _check(self, loop: Thread) -> None:
        """Stop with a reason if a thread died; note one that hangs, and a step of the wall
        clock.
        """
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
                f"wall clock stepped by {offset - self._wall_offset:+.3f} s;"
                " stamps keep the old one",
            )
            self._wall_offset = offset

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
        mode=MODES[logging.readable_by],
    )


def _inside(reader: ReaderThread) -> str:
    return reader.inside


def _beats(reader: ReaderThread) -> int:
    return reader.beats
