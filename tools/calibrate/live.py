"""The live sensors: one known value after the other is set, and read for some seconds."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gritd.drivers.build import build_readers
from gritd.drivers.queue import ReadingQueue
from gritd.estimator.config.settings import Settings, Uncertain
from gritd.estimator.messages.readings import CHANNELS, NS, Reading
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.calibrate import spikes
from gritd.tools.calibrate.line import Point
from gritd.tools.calibrate.plateaus import Plateau, creep_of, mean_of
from gritd.tools.calibrate.sources import Signal, points_of
from gritd.tools.cli.command import FAILED, CommandError
from gritd.tools.cli.terminal import LiveLine

PATIENCE = 5.0  # [s] for a reading
SHOWN = 0.2  # [s] between two lines of what is seen

Flags = NDArray[np.bool_]
Drain = Callable[[], list[Reading]]


@dataclass(frozen=True)
class Live:
    """The configured sensors. `ask` says what is to be set and waits until it is."""

    settings: Settings
    seconds: float
    ask: Callable[[str], None]
    shown: str  # unit of the known values
    factor: float  # SI value of it

    def points(self, signal: Signal, known: Sequence[Uncertain]) -> list[Point]:
        """Raises CommandError where the sensor says nothing."""
        with reading(self.settings) as drain:
            read = [self._one(drain, signal, value) for value in known]
        spiky = spikes.note(np.concatenate([found for _, found in read]), signal.channel)
        return points_of([one for one, _ in read], known, signal, spiky)

    def touches(self, signal: Signal, count: int) -> list[float]:
        """Readings at so many touches of the surface."""
        with reading(self.settings) as drain:
            read = []
            for number in range(1, count + 1):
                self.ask(f"touch {number} of {count}: lower the wheel until it just touches")
                read.append(mean_of(self._read(drain, signal)[1]).value)
            return read

    def _one(self, drain: Drain, signal: Signal, known: Uncertain) -> tuple[Plateau, Flags]:
        """What is read at one value, and which of the readings were spikes."""
        self.ask(f"set {known.value / self.factor:g} {self.shown}")
        seconds, values, found = self._read(drain, signal)
        creeps = creep_of(seconds, values)
        return Plateau(float(seconds[0]), float(seconds[-1]), mean_of(values), creeps), found

    def _read(self, drain: Drain, signal: Signal) -> tuple[Array, Array, Flags]:
        """Times [s] and raw values of some seconds, beginning now, without spikes, and which of all
        readings these were; shows what it sees.
        """
        drain()
        line, values, stamps = LiveLine(sys.stderr), list[float](), list[int]()
        begin = last = time.monotonic()

        while (now := time.monotonic()) - begin < self.seconds or not values:
            time.sleep(0.02)
            own = [r for r in drain() if r.channel == signal.channel]
            values += [_value(r, signal) for r in own]
            stamps += [r.stamp for r in own]

            if not values and now - begin > PATIENCE:
                raise CommandError(
                    f"{signal.channel}: found no reading in {PATIENCE:g} s; "
                    "expected the sensor connected",
                    FAILED,
                )

            if values and line.terminal and now - last > SHOWN:
                last = now
                line.show(
                    f"{signal.channel} {values[-1]:.6g} {signal.unit}, {len(values)} readings"
                )

        line.clear()
        read = np.array(values)
        found = spikes.spikes(read)
        spikes.note(found, signal.channel)
        return np.array(stamps)[~found] / NS, read[~found], found


def _value(reading: Reading, signal: Signal) -> float:
    if isinstance(reading.value, tuple):
        return float(reading.value[CHANNELS[signal.channel].index(signal.field)])
    return float(reading.value)


@contextmanager
def reading(settings: Settings) -> Iterator[Drain]:
    """All configured devices, read while the block lasts."""
    queue = ReadingQueue()
    readers = build_readers(settings, time.time_ns, queue)
    for reader in readers:
        reader.start()
    try:
        yield queue.drain
    finally:
        for reader in readers:
            reader.stop()
