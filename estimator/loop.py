"""The 250 Hz loop: absolute deadlines, every miss counted, all estimator state its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from threading import Event
from typing import NamedTuple, Protocol

from estimator.clock import Clock
from estimator.pipeline import Pipeline, TickRecord
from estimator.readings import Reading
from estimator.sync import NS


class LoopRecord(NamedTuple):
    """One /loop message: what only the live loop can know. Order of record.LOOP_FIELDS."""

    stamp: int  # [ns]
    lateness: float  # [s]
    duration: float  # [s]
    missed: int
    queued: int
    dropped: int
    log_queued: int
    log_dropped: int
    wall_offset: float  # [s]


class Sink(Protocol):
    """Where ticks go: the writer."""

    def put(self, readings: Sequence[Reading], tick: TickRecord, loop: LoopRecord) -> None:
        """Must not block."""

    def counts(self) -> tuple[int, int]:
        """(waiting, dropped since the start)"""


class Source(Protocol):
    """Where readings come from: the queue behind the readers."""

    def drain(self) -> list[Reading]: ...

    def dropped(self) -> int: ...


class Loop:
    """Ticks until told to stop. `latest` is the last tick and loop record, for whoever watches."""

    def __init__(self, pipeline: Pipeline, source: Source, sink: Sink, clock: Clock) -> None:
        self._pipeline, self._source, self._sink, self._clock = pipeline, source, sink, clock
        self._period = round(NS / pipeline.settings.rates.tick)
        self.latest: tuple[TickRecord, LoopRecord] | None = None
        self.ticks = self.missed = 0

    def run(self, stop: Event, beat: Callable[[], None] = lambda: None) -> None:
        """`beat` is called after every tick: the watchdog's pulse."""
        state = self._pipeline.start()
        deadline = self._clock.now() + self._period
        while not stop.is_set():
            self._clock.sleep_until(deadline)
            woken = self._clock.now()
            readings = self._source.drain()
            state, tick = self._pipeline.step(state, readings, deadline)
            self._hand_over(readings, tick, deadline, woken)
            beat()
            deadline = self._next(deadline)

    def _hand_over(self, readings: list[Reading], tick: TickRecord, deadline: int, woken: int) -> None:
        waiting, dropped = self._sink.counts()
        loop = LoopRecord(
            stamp=deadline,
            lateness=(woken - deadline) / NS,
            duration=(self._clock.now() - woken) / NS,
            missed=self.missed,
            queued=len(readings),
            dropped=self._source.dropped(),
            log_queued=waiting,
            log_dropped=dropped,
            wall_offset=self._clock.wall_offset(),
        )
        self._sink.put(readings, tick, loop)
        self.latest = (tick, loop)
        self.ticks += 1

    def _next(self, deadline: int) -> int:
        """The next deadline that has not passed by a whole period; the ones between are missed."""
        skipped = max((self._clock.now() - deadline - self._period) // self._period, 0)
        self.missed += skipped
        return deadline + (skipped + 1) * self._period
