"""What `gritd run` does besides its threads, ten times a second: tell people and the service
manager, reload, tidy.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from threading import Thread

from gritd.drivers.queue import ReadingQueue
from gritd.drivers.reader import Reader
from gritd.estimator.config.configuration import Configuration, reload
from gritd.estimator.config.yamltree import ConfigError
from gritd.estimator.daemon import notify
from gritd.estimator.daemon.daemon import INFO, WARNING, WATCH, Daemon, DaemonError
from gritd.estimator.daemon.lock import FolderLock, LockError
from gritd.estimator.daemon.loop import Change
from gritd.estimator.daemon.notify import Notifier
from gritd.estimator.daemon.publish import Publisher
from gritd.estimator.messages.status import Flag, Status
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.recording.retention import trim
from gritd.tools.service.journal import Journal, say, tell

HOLD = 1.0  # [s] between looks at the log folder
TIDY = 5.0  # [s] between looks at the disk


class Watcher:
    """Called by Daemon.serve. Prints a line of status now and then."""

    def __init__(
        self,
        config: str,
        readers: Sequence[Reader],
        queue: ReadingQueue,
        publisher: Publisher,
        lock: FolderLock,
        every: float,
    ) -> None:
        self._config, self._readers, self._queue = config, readers, queue
        self._journal = Journal(readers, queue, publisher)
        self._notifier = Notifier()
        self._lock = lock
        self._every = every

        self._unheld = self._untidy = ""
        self._calls = 0
        self._ready = self._reload_asked = False
        self._loading: Thread | None = None  # of a configuration
        self._loaded: str | tuple[Configuration, Change | None] = ""  # what it found

    def ask_reload(self) -> None:
        """At the next call; may be called from a signal handler."""
        self._reload_asked = True

    def __call__(self, daemon: Daemon) -> None:
        self._journal(daemon)
        if self._reload_asked and self._loading is None:
            self._reload_asked = False
            self._begin_reload(daemon)

        if self._loading is not None and not self._loading.is_alive():
            self._loading = None
            self._end_reload(daemon)

        if self._due(HOLD):
            self._hold(daemon)
        if self._due(TIDY):
            self._tidy(daemon)

        self._notify(daemon)
        if self._due(self._every):
            say(status_line(daemon))

        self._calls += 1

    def _due(self, period: float) -> bool:
        return period > 0 and (self._calls + 1) % max(round(period / WATCH), 1) == 0

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
            tell(daemon, WARNING, f"{self._loaded}; the old configuration is kept")
        else:
            configuration, change = self._loaded
            if change is not None:
                daemon.reload(configuration, change)
            tell(daemon, INFO, f"{self._config}: {'reloaded' if change else 'unchanged'}")
        self._notifier.tell(notify.READY)

    def _hold(self, daemon: Daemon) -> None:
        """Make the log folder again where somebody removed it, and hold it as at the start."""
        trouble = ""
        try:
            if self._lock.renew():
                folder = self._lock.folder
                tell(daemon, WARNING, f"{folder}: was removed while it was used; made again")
        except LockError as error:
            trouble = str(error)

        if trouble and trouble != self._unheld:
            tell(daemon, WARNING, trouble)
        self._unheld = trouble

    def _tidy(self, daemon: Daemon) -> None:
        """Keep the recordings under their cap."""
        open_file = daemon.writer.status().files[-1]
        trouble = ""

        try:
            for path in trim(
                open_file.parent, daemon.configuration.settings.logging.disk_cap, [open_file]
            ):
                tell(daemon, INFO, f"{path}: deleted, over logging.disk_cap")
        except OSError as error:
            trouble = (
                f"{error.filename or open_file.parent}: logging.disk_cap cannot be kept: "
                f"{error.strerror}"
            )

        if trouble and trouble != self._untidy:
            tell(daemon, WARNING, trouble)
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
                f"{s.turns_unknown} turns unknown, {s.unknown} unknown, {s.errors} bus errors, "
                f"reopened {s.reopened} times"
            )

        say(f"loop: {daemon.loop.ticks} ticks, {daemon.loop.missed} missed")


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
    line = line.replace("nan", "  –")  # what is not known yet
    return f"{line}  {' '.join(flags)}".rstrip()
