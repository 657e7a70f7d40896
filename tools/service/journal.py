"""What people read of the running daemon, in its journal and in the recording's /log: every
change of what works and what does not, with how often and how long.
"""

from __future__ import annotations

import io
import os
import select
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import TextIO

from gritd.drivers.queue import ReadingQueue
from gritd.drivers.reader import Reader, ReaderStats
from gritd.estimator.config.settings import settings_of_run
from gritd.estimator.daemon.daemon import INFO, WARNING, Daemon
from gritd.estimator.daemon.notice import Notice
from gritd.estimator.daemon.publish import Publisher
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.recording.writer import WriterStatus
from gritd.tools.service.first_look import FirstLook
from gritd.tools.service.incidents import Limited, Recurring
from gritd.tools.service.telemetry import channels_of

NS = 1e-9
MEDIUM_PATIENCE = 10.0  # [s] after which a medium that confirms nothing is worth a line
LISTENING = 50  # [ms] given to whoever reads our lines and is behind
OF_DEVICE = {  # of ReaderStats
    "bad": "bad frames",
    "garbage": "bytes of garbage",
    "lost": "frames lost",
    "errors": "error frames",
    "quarantined": "impossible values refused",
    "incomplete": "incomplete cycles of the wrench",
    "mistimed": "frames of a wrong device time",
    "turns_unknown": "turns unknown, an encoder was silent while its counter may have wrapped",
}
OF_TICK = {
    "late": "readings older than the horizon",
    "duplicates": "readings that came twice",
    "jumps": "jumps of an encoder",
    "invalid": "readings out of range",
}


class Journal:
    """Called ten times a second. Lines about one subject are limited in number, and what was left
    out is counted.
    """

    def __init__(
        self, readers: Sequence[Reader], queue: ReadingQueue, publisher: Publisher
    ) -> None:
        self._readers, self._queue, self._publisher = readers, queue, publisher
        self._limits: defaultdict[str, Limited] = defaultdict(Limited)
        self._counts: dict[tuple[str, str], Recurring] = {}
        self._first = FirstLook()

        self._states = {reader.device: "" for reader in readers}
        self._hints = {reader.device: "" for reader in readers}
        self._steps = {reader.device: 0 for reader in readers}
        self._writing, self._files, self._hanging, self._unconfirmed = "writing", 1, "", False
        self._dropped = 0  # messages, when the log began to fail

    def __call__(self, daemon: Daemon) -> None:
        now = daemon.clock.now() * NS
        for reader in self._readers:
            stats = reader.stats()
            subject = f"device {reader.device}"
            self._tell(daemon, subject, now, self._device(stats))
            # a subject of its own: a count must not take the place of how the port stands
            self._tell(daemon, f"{subject}, amiss", now, self._counted(stats, now))

        self._tell(daemon, "queue", now, self._queue_fell_behind(now))
        self._tell(daemon, "log", now, self._log(daemon, now))
        if daemon.loop.latest is not None:
            tick, loop = daemon.loop.latest
            self._tell(daemon, "channels", now, daemon.feed.look(tick, channels_of(daemon)))
            self._tell(daemon, "model", now, daemon.model.look(tick))
            settings = settings_of_run(daemon.configuration.settings, daemon.run)
            self._tell(daemon, "run", now, self._first.look(tick, settings))
            self._tell(daemon, "readings", now, self._ticked(tick, loop.missed, now))
        self._tell(daemon, "threads", now, self._threads(daemon))

    def _tell(
        self, daemon: Daemon, subject: str, now: float, notices: Sequence[Notice] | Iterator[Notice]
    ) -> None:
        limited = self._limits[subject]
        for notice in (*notices, None):
            if notice is not None:
                limited.offer(notice)
            if (due := limited.due(now)) is not None:
                tell(daemon, INFO if due.over else WARNING, due.text)

    # --- subjects ---

    def _device(self, stats: ReaderStats) -> Iterator[Notice]:
        """Its port, and the clock of what is behind it."""
        device = f"device {stats.device}"
        if stats.clock_steps > self._steps[stats.device]:
            self._steps[stats.device] = stats.clock_steps
            yield Notice(f"{device}: its clock stepped by {stats.clock_step:+.3f} s")

        if stats.hint != self._hints[stats.device]:
            self._hints[stats.device] = stats.hint
            yield Notice(f"{device}: {stats.hint or 'as configured again'}", over=not stats.hint)

        beginning = stats.state == "WAITING" and not stats.last_error  # for its first attempt
        if stats.state != self._states[stats.device] and not beginning:
            self._states[stats.device] = stats.state
            well = stats.state in ("OPEN", "ENDED")
            yield Notice(f"{device} {stats.state} {stats.last_error}", over=well)

    def _counted(self, stats: ReaderStats, now: float) -> Iterator[Notice]:
        """What a device sends amiss."""
        for name, words in OF_DEVICE.items():
            what = f"device {stats.device}: {words}"
            yield from self._count(stats.device, what, getattr(stats, name), now)

    def _ticked(self, tick: tuple[float, ...], missed: int, now: float) -> Iterator[Notice]:
        """Readings that the filter could not use, and ticks that came too late."""
        for name, words in OF_TICK.items():
            yield from self._count("tick", words, int(tick[TICK_NAMES.index(name)]), now)
        yield from self._count("loop", "ticks missed", missed, now)

    def _queue_fell_behind(self, now: float) -> Iterator[Notice]:
        """Readings that the loop did not take in time: the oldest are dropped."""
        dropped = self._queue.counts().dropped
        yield from self._count(
            "queue", "queue: the loop fell behind, readings dropped", dropped, now
        )

    def _count(self, subject: str, what: str, total: int, now: float) -> Iterator[Notice]:
        recurring = self._counts.setdefault((subject, what), Recurring(what))
        if (notice := recurring.look(total, now)) is not None:
            yield notice

    def _log(self, daemon: Daemon, now: float) -> Iterator[Notice]:
        """Where it is written, and what stands in its way."""
        waiting = daemon.writer.unconfirmed
        if (waiting > MEDIUM_PATIENCE) != self._unconfirmed:
            self._unconfirmed = not self._unconfirmed
            if self._unconfirmed:
                yield Notice(f"log: the medium has confirmed nothing for {waiting:.0f} s")
            else:
                yield Notice("log: the medium confirms again", over=True)

        status = daemon.writer.status()
        if status.state != self._writing:
            yield self._turned(status)
        yield from self._unfit(status, now)
        yield from self._parts(daemon, status)

    def _turned(self, status: WriterStatus) -> Notice:
        """The log fails, or is written again."""
        self._writing = status.state
        if status.state != "writing":
            self._dropped = status.dropped
            return Notice(f"log {status.state} {status.error}", over=status.state == "closed")
        lost = status.dropped - self._dropped
        what = f"{lost} messages were lost" if lost else "nothing was lost"
        return Notice(f"log writing again, {what}: {status.files[-1]}", over=True)

    def _unfit(self, status: WriterStatus, now: float) -> Iterator[Notice]:
        """Messages that could not be written because of themselves."""
        what = "log: messages could not be written"
        for notice in self._count("log", what, status.unfit, now):
            yield notice if notice.over else Notice(f"{notice.text}; the last: {status.error}")

    def _parts(self, daemon: Daemon, status: WriterStatus) -> Iterator[Notice]:
        if len(status.files) <= self._files:
            return
        self._files = len(status.files)
        yield Notice(f"logging to {status.files[-1]}", over=True)
        while daemon.rotation.deleted:
            yield Notice(f"{daemon.rotation.deleted.pop()}: was deleted while it was written")

    def _threads(self, daemon: Daemon) -> Iterator[Notice]:
        if not self._publisher.alive:
            daemon.fail("thread died: publisher")
        if daemon.health == self._hanging:
            return
        self._hanging = daemon.health
        if daemon.health:
            yield Notice(f"hanging: {daemon.health}; the watchdog is not stroked")
        else:
            yield Notice("nothing hangs any more", over=True)


def tell(daemon: Daemon, level: int, text: str) -> None:
    """A line for people, and the same in /log."""
    say(text.strip(), sys.stderr if level > INFO else sys.stdout)
    daemon.say(level, text.strip())


def say(text: str, stream: TextIO | None = None) -> None:
    """A line for people. Where nobody listens any more, on a terminal that was closed, a daemon
    goes on; where somebody does not read what he asked for, it goes on without the line.
    """
    out = stream or sys.stdout
    try:
        if _taken(out):
            print(text, file=out, flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), out.fileno())


def _taken(out: TextIO) -> bool:
    """Whether a line can be written without waiting for its reader: a full pipe would hold up the
    end, too.
    """
    try:
        waiting = select.poll()
        waiting.register(out, select.POLLOUT)
    except (ValueError, io.UnsupportedOperation):  # a stream of Python's own
        return True
    return bool(waiting.poll(LISTENING))
