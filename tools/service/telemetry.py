"""What the running daemon tells of itself: the mapping that goes out on its status socket, in SI
units.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gritd.drivers.queue import ReadingQueue
from gritd.drivers.reader import Reader
from gritd.drivers.sensor import Sensor
from gritd.estimator.compiled import arithmetic
from gritd.estimator.daemon.daemon import Daemon
from gritd.estimator.messages.status import CHANNEL_BITS, Flag, Status
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.messages.update import UPDATE_NAMES
from gritd.tools.service.setup import setup

Report = dict[str, Any]

LOG = ("state", "error", "accepted", "written", "dropped", "queued")  # of WriterStatus


class Reporter:
    """Makes reports of one daemon; called by the publisher's thread, ten times a second at most."""

    def __init__(
        self, daemon: Daemon, readers: Sequence[Reader], queue: ReadingQueue, notice: str
    ) -> None:
        self._daemon, self._readers, self._queue, self._notice = daemon, readers, queue, notice
        self._began = time.monotonic()
        self._rates: dict[
            str, tuple[float, int, float]
        ] = {}  # device or channel -> when, readings then, rate before

    def __call__(self) -> Report:
        daemon = self._daemon
        log, disagreement = daemon.writer.status(), daemon.model.present

        return {
            "pid": os.getpid(),
            "uptime": time.monotonic() - self._began,
            "healthy": not (daemon.health or daemon.feed.unfed),
            "hanging": daemon.health,
            "unfed": daemon.feed.unfed,
            "real_time": self._notice or "yes",
            "arithmetic": "compiled" if arithmetic.BUILT else arithmetic.IN_PYTHON,
            "wall_clock": daemon.clock.notice,
            "configuration": daemon.configuration.source,
            "setup": setup(daemon.configuration.settings, daemon.run.name),
            **_tick(daemon),
            "disagreement": disagreement and disagreement._asdict(),
            "queue": self._queue.counts()._asdict(),
            "devices": {reader.device: self._device(reader) for reader in self._readers},
            "sensors": {
                sensor.channel: self._sensor(sensor)
                for reader in self._readers
                for sensor in reader.decoder.sensors
            },
            "log": {
                **{name: getattr(log, name) for name in LOG},
                "files": len(log.files),
                "file": str(log.files[-1]),
                **_room(log.files[-1]),
            },
        }

    def _sensor(self, sensor: Sensor) -> Report:
        """Of a channel: values passed on, how many a second, age of the newest [s]."""
        age = (self._daemon.clock.now() - sensor.newest) * 1e-9 if sensor.readings else None
        rate = self._rate(f"channel {sensor.channel}", sensor.readings)
        return {"readings": sensor.readings, "rate": rate, "age": age}

    def _device(self, reader: Reader) -> Report:
        stats = asdict(reader.stats())
        stats["silent_for"] = (self._daemon.clock.now() - stats.pop("last_received")) * 1e-9
        stats["rate"] = self._rate(stats["device"], stats["readings"])
        return stats

    def _rate(self, device: str, readings: int) -> float:
        """Readings a second, over the last second or more."""
        now = time.monotonic()
        when, before, rate = self._rates.get(device, (self._began, 0, 0.0))
        if now - when >= 1.0:
            rate = (readings - before) / (now - when)
            self._rates[device] = (now, readings, rate)
        return rate


def _tick(daemon: Daemon) -> Report:
    """The latest tick, what the loop says of it, and the latest update; empty before the first."""
    loop = {"ticks": daemon.loop.ticks, **daemon.loop.lateness()}
    if daemon.loop.latest is None:
        none: Report = {"tick": {}, "update": {}, "channels": {}}
        return {"status": "STARTING", "flags": [], "loop": loop, **none}

    tick, record = daemon.loop.latest
    update = daemon.loop.update
    fields = dict(zip(TICK_NAMES, tick, strict=True))

    return {
        "status": Status(int(fields["status"])).name,
        "flags": [flag.name for flag in Flag if flag and int(fields["flags"]) & flag],
        "channels": {name: _condition(fields, bit) for name, bit in channels_of(daemon).items()},
        "tick": fields,
        "update": dict(zip(UPDATE_NAMES, update, strict=True)) if update else {},
        "loop": {**record._asdict(), **loop},
    }


def _room(path: Path) -> Report:
    """Bytes of the open part, and those that its disk has left; nothing where nobody can tell."""
    with suppress(OSError):
        disk = os.statvfs(path.parent)
        return {"size": path.stat().st_size, "free": disk.f_bavail * disk.f_frsize}
    return {}


def channels_of(daemon: Daemon) -> dict[str, int]:
    """CHANNEL_BITS of the channels that are configured."""
    settings = daemon.configuration.settings
    used = {*settings.channels, *(("wrench",) if settings.wrench else ())}
    return {name: bit for name, bit in CHANNEL_BITS.items() if name in used}


def _condition(fields: dict[str, float], bit: int) -> str:
    return (
        "stale" if int(fields["stale"]) & bit else "stuck" if int(fields["stuck"]) & bit else "ok"
    )
