"""What `gritd run` does beside its threads, ten times a second: tell people and the service
manager, reload, tidy.
"""

from __future__ import annotations

import io
import os
import select
import sys
from collections.abc import Sequence
from math import degrees
from threading import Thread
from typing import TextIO

from gritd.drivers.queue import ReadingQueue
from gritd.drivers.reader import Reader, ReaderStats
from gritd.estimator.config.configuration import Configuration, reload
from gritd.estimator.config.yamltree import ConfigError
from gritd.estimator.daemon import notify
from gritd.estimator.daemon.daemon import INFO, WARNING, WATCH, Daemon, DaemonError
from gritd.estimator.daemon.loop import Change
from gritd.estimator.daemon.notify import Notifier
from gritd.estimator.daemon.publish import Publisher
from gritd.estimator.messages.status import Flag, Status
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.recording.retention import trim

TIDY = 5.0  # [s] between looks at the disk
MEDIUM_PATIENCE = 10.0  # [s] after which a medium that confirms nothing is worth a line
LISTENING = 50  # [ms] given to whoever reads our lines and is behind


class Watcher:
    """Called by Daemon.serve. Prints a line of status now and then, and every change of a device's
    state at once.
    """

    def __init__(
        self,
        config: str,
        readers: Sequence[Reader],
        queue: ReadingQueue,
        publisher: Publisher,
        every: float,
    ) -> None:
        self._config, self._readers, self._queue, self._publisher = (
            config,
            readers,
            queue,
            publisher,
        )

        self._notifier = Notifier()
        self._every = every

        self._states = {reader.device: "" for reader in readers}
        self._steps = {reader.device: 0 for reader in readers}
        self._writing, self._files, self._hanging, self._untidy = "writing", 1, "", ""
        self._dropped, self._unfit = 0, 0
        self._overflowing = self._unconfirmed = False

        self._calls = 0
        self._ready = self._reload_asked = False
        self._loading: Thread | None = None  # of a configuration
        self._loaded: str | tuple[Configuration, Change | None] = ""  # what it found

    def ask_reload(self) -> None:
        """At the next call; may be called from a signal handler."""
        self._reload_asked = True

    def __call__(self, daemon: Daemon) -> None:
        for reader in self._readers:
            self._follow(daemon, reader.stats())
        self._follow_queue(daemon)
        self._follow_writer(daemon)
        self._follow_model(daemon)
        self._follow_health(daemon)

        if self._reload_asked and self._loading is None:
            self._reload_asked = False
            self._begin_reload(daemon)

        if self._loading is not None and not self._loading.is_alive():
            self._loading = None
            self._end_reload(daemon)

        if self._due(TIDY):
            self._tidy(daemon)

        self._notify(daemon)
        if self._due(self._every):
            say(status_line(daemon))

        self._calls += 1

    def _due(self, period: float) -> bool:
        return period > 0 and (self._calls + 1) % max(round(period / WATCH), 1) == 0

    # --- what is told
    # ---------------------------------------------------------------------------------------------

    def _follow(self, daemon: Daemon, stats: ReaderStats) -> None:
        if stats.clock_steps > self._steps[stats.device]:
            self._steps[stats.device] = stats.clock_steps
            step = f"device {stats.device}: its clock stepped by {stats.clock_step:+.3f} s"
            self.tell(daemon, WARNING, step)
        beginning = stats.state == "WAITING" and not stats.last_error  # for its first attempt
        if stats.state == self._states[stats.device] or beginning:
            return
        self._states[stats.device] = stats.state
        trouble = stats.state not in ("OPEN", "ENDED")
        self.tell(
            daemon,
            WARNING if trouble else INFO,
            f"device {stats.device} {stats.state} {stats.last_error}",
        )

    def _follow_queue(self, daemon: Daemon) -> None:
        """Readings that the loop did not take in time: the oldest are dropped; said once a second
        at most.
        """
        dropped, begins = self._queue.counts().dropped, False
        if dropped > self._dropped and not self._overflowing:
            begins = self._overflowing = True

        if begins or (self._overflowing and self._due(1.0)):
            new, self._dropped = dropped - self._dropped, dropped
            self._overflowing = new > 0
            if new:
                self.tell(
                    daemon,
                    WARNING,
                    f"queue: the loop fell behind, {new} readings dropped, {dropped} in all",
                )

    def _follow_writer(self, daemon: Daemon) -> None:
        waiting = daemon.writer.unconfirmed
        if (waiting > MEDIUM_PATIENCE) != self._unconfirmed:
            self._unconfirmed = not self._unconfirmed
            text = (
                f"has confirmed nothing for {waiting:.0f} s"
                if self._unconfirmed
                else "confirms again"
            )
            self.tell(daemon, WARNING if self._unconfirmed else INFO, f"log: the medium {text}")

        status = daemon.writer.status()
        if status.state != self._writing:
            self._writing = status.state
            self.tell(
                daemon,
                WARNING if status.state == "degraded" else INFO,
                f"log {status.state} {status.error}",
            )

        if status.unfit > self._unfit and self._due(1.0):
            new, self._unfit = status.unfit - self._unfit, status.unfit
            line = f"log: {new} messages could not be written, {status.unfit} in all; the last: "
            self.tell(daemon, WARNING, line + status.error)

        if len(status.files) > self._files:
            self._files = len(status.files)
            self.tell(daemon, INFO, f"logging to {status.files[-1]}")
            while daemon.rotation.deleted:
                self.tell(
                    daemon,
                    WARNING,
                    f"{daemon.rotation.deleted.pop()}: was deleted while it was written",
                )

    def _follow_model(self, daemon: Daemon) -> None:
        """What begins or ends of the model's agreement with what is measured."""
        if daemon.loop.latest is None:
            return
        for notice in daemon.model.look(daemon.loop.latest[0]):
            self.tell(daemon, INFO if notice.over else WARNING, notice.text)

    def _follow_health(self, daemon: Daemon) -> None:
        if not self._publisher.alive:
            daemon.fail("thread died: publisher")
        if daemon.health != self._hanging:
            self._hanging = daemon.health
            text = (
                f"hanging: {daemon.health}; the watchdog is not stroked"
                if daemon.health
                else "nothing hangs any more"
            )
            self.tell(daemon, WARNING if daemon.health else INFO, text)

    def tell(self, daemon: Daemon, level: int, text: str) -> None:
        """A line for people, and the same in /log."""
        say(text.strip(), sys.stderr if level > INFO else sys.stdout)
        daemon.say(level, text.strip())

    def _notify(self, daemon: Daemon) -> None:
        """The service manager hears READY after the first tick, and of the watchdog while
        everything moves.
        """
        if not self._ready and daemon.loop.ticks:
            self._ready = True
            self._notifier.tell(notify.READY)
        if self._notifier.interval and self._due(self._notifier.interval) and not daemon.health:
            self._notifier.tell(notify.WATCHDOG)
        if self._due(1.0):
            self._notifier.tell(notify.status(status_line(daemon)))

    # --- what is done
    # ---------------------------------------------------------------------------------------------

    def _begin_reload(self, daemon: Daemon) -> None:
        """Read the configuration again, from a thread: the watchdog is stroked meanwhile."""
        self._notifier.tell(notify.reloading())
        self._loading = Thread(target=self._load, args=(daemon,), name="reload", daemon=True)
        self._loading.start()

    def _load(self, daemon: Daemon) -> None:
        try:
            configuration = reload(self._config)
            self._loaded = configuration, daemon.change_to(configuration)
        except (ConfigError, DaemonError) as error:
            self._loaded = str(error)
        except Exception as error:  # a fault of ours must not leave the manager waiting
            self._loaded = f"{self._config}: {type(error).__name__}: {error}"

    def _end_reload(self, daemon: Daemon) -> None:
        """Take over what was read; a bad one changes nothing."""
        if isinstance(self._loaded, str):
            self.tell(daemon, WARNING, f"{self._loaded}; the old configuration is kept")
        else:
            configuration, change = self._loaded
            if change is not None:
                daemon.reload(configuration, change)
            self.tell(daemon, INFO, f"{self._config}: {'reloaded' if change else 'unchanged'}")
        self._notifier.tell(notify.READY)

    def _tidy(self, daemon: Daemon) -> None:
        """Keep the recordings under their cap."""
        open_file = daemon.writer.status().files[-1]
        trouble = ""

        try:
            for path in trim(
                open_file.parent, daemon.configuration.settings.logging.disk_cap, [open_file]
            ):
                self.tell(daemon, INFO, f"{path}: deleted, over logging.disk_cap")
        except OSError as error:
            trouble = (
                f"{error.filename or open_file.parent}: logging.disk_cap cannot be kept: "
                f"{error.strerror}"
            )

        if trouble and trouble != self._untidy:
            self.tell(daemon, WARNING, trouble)
        self._untidy = trouble

    def report(self, daemon: Daemon) -> None:
        """Every counter, once, at the end."""
        self._notifier.tell(notify.STOPPING)

        counts = self._queue.counts()
        say(
            f"queue: received {counts.received} = processed {counts.processed} + dropped "
            f"{counts.dropped} + queued {counts.queued}"
        )

        for reader in self._readers:
            s = reader.stats()
            say(
                f"device {s.device}: {s.readings} readings, {s.frames} frames, {s.bad} bad, "
                f"{s.garbage} garbage bytes, {s.lost} lost, {s.duplicates} duplicates, "
                f"{s.quarantined} quarantined, {s.incomplete} incomplete, {s.mistimed} mistimed, "
                f"{s.unknown} unknown, {s.errors} bus errors, reopened {s.reopened} times"
            )

        say(f"loop: {daemon.loop.ticks} ticks, {daemon.loop.missed} missed")


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


def status_line(daemon: Daemon) -> str:
    """The latest tick in one line."""
    if daemon.loop.latest is None:
        return "no tick yet"

    tick, loop = daemon.loop.latest
    t = dict(zip(TICK_NAMES, tick, strict=True))
    line = (
        f"{Status(int(t['status'])).name:10} slip {t['slip']:6.1%}  z {t['sinkage'] * 1e3:5.1f} "
        f"mm  θ₁ {degrees(t['theta_1']):4.1f}°  W {t['load']:5.1f} N  T {t['torque']:5.2f} N·m  c "
        f"{t['cohesion']:6.0f} ± {t['cohesion_sigma']:4.0f} Pa  tan φ {t['tan_phi']:.3f} ± "
        f"{t['tan_phi_sigma']:.3f}  late {loop.lateness * 1e3:.2f} ms"
    )

    flags = [flag.name or "" for flag in Flag if flag and int(t["flags"]) & flag]
    return f"{line}  {' '.join(flags)}".rstrip()
