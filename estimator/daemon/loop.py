"""The 250 Hz loop: absolute deadlines, every miss counted, all estimator state its own."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from threading import Event
from typing import NamedTuple, Protocol

from gritd.estimator.daemon.clock import Clock
from gritd.estimator.filter.track import TrackState
from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.messages.readings import NS, Reading
from gritd.estimator.messages.tick import LoopRecord, TickRow
from gritd.estimator.messages.update import update_of
from gritd.estimator.online.bed import RunStart, begun
from gritd.estimator.online.carry import carry_over
from gritd.estimator.online.checkpoint import encode
from gritd.estimator.online.pipeline import Pipeline, State

RECENT = 2500  # ticks whose lateness is remembered
_SHARES = {"late_50": 0.5, "late_99": 0.99, "late_999": 0.999, "late_max": 1.0}
MEND = NS  # [ns] after a loss in the log the state is logged anew, at most this often


class Change(NamedTuple):
    """Asked of the loop between two ticks: a new part of the log; with a pipeline, a new
    configuration too.
    """

    configuration: str  # effective text
    pipeline: Pipeline | None = None


class Sink(Protocol):
    """Where ticks go: the writer."""

    def put(self, readings: Sequence[Reading], tick: TickRow, loop: LoopRecord) -> None:
        """Must not block."""

    def counts(self) -> tuple[int, int]:
        """(waiting, dropped since the start)"""

    def checkpoint(self, stamp: int, configuration: str, state: str, new_part: bool) -> None:
        """The configuration and the state that the next tick begins with. Must not block."""


class ReadingSource(Protocol):
    """Where readings come from: the queue behind the readers."""

    def drain(self) -> list[Reading]: ...

    def dropped(self) -> int: ...


class Loop:
    """Ticks until told to stop. `latest` is the last tick and loop record, `update` the last update
    of the filter, for whoever watches.
    """

    def __init__(
        self,
        pipeline: Pipeline,
        source: ReadingSource,
        sink: Sink,
        clock: Clock,
        configuration: str = "",
        start: RunStart | None = None,
    ) -> None:
        """start: what the run begins with in the place of the stated prior."""
        self._pipeline, self._source, self._sink, self._clock = pipeline, source, sink, clock
        self._configuration = configuration
        self._period = round(NS / pipeline.settings.rates.tick)
        self._asked: deque[Change] = deque()
        self._log_dropped = 0  # as of the last checkpoint
        self._checkpointed = 0  # when that was [ns]
        self._lateness: deque[float] = deque(maxlen=RECENT)

        self.latest: tuple[TickRow, LoopRecord] | None = None
        self.update: TickRow | None = None
        self.ticks = self.missed = 0
        self._start = start
        self.left: TrackState | None = None  # at the end

    def ask(self, change: Change) -> None:
        """To be done between two ticks; from any thread."""
        self._asked.append(change)

    def lateness(self) -> dict[str, float]:
        """Percentiles of the last ticks' lateness [s]; from any thread."""
        recent = sorted(self._lateness.copy())
        if not recent:
            return {}
        return {
            name: recent[min(int(share * len(recent)), len(recent) - 1)]
            for name, share in _SHARES.items()
        }

    def run(self, stop: Event) -> None:
        """Tick at every deadline; one more tick after the stop takes what the readers left."""
        deadline = self._clock.now() + self._period
        state = self._begun(deadline - self._period)
        last = False
        while not last:
            last = stop.is_set()
            self._clock.sleep_until(deadline)
            woken = self._clock.now()
            readings = self._source.drain()
            state, tick = self._pipeline.step(state, readings, deadline)
            self._hand_over(readings, tick, deadline, woken)
            state = self._between(state, deadline)
            deadline = self._next(deadline)

        self.left = self._pipeline.tracker.concluded(state.track)

    @property
    def tracker(self) -> Tracker:
        """Of the configuration that holds now."""
        return self._pipeline.tracker

    def _begun(self, stamp: int) -> State:
        """The state before the first tick; logged where it is not the stated prior."""
        state = self._pipeline.start()
        if self._start is not None:
            state = replace(state, track=begun(state.track, self._start))
            self._checkpoint(state, stamp, 0, new_part=False)
        return state

    def _hand_over(self, readings: list[Reading], tick: TickRow, deadline: int, woken: int) -> None:
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
        self._lateness.append(loop.lateness)
        self.latest = (tick, loop)
        self.update = update_of(tick) or self.update
        self.ticks += 1

    def _between(self, state: State, stamp: int) -> State:
        """Take over what was asked for. After a loss in the log too, log what a replay needs to go
        on.
        """
        dropped = self.latest[1].log_dropped if self.latest else 0

        if self._asked:
            change = self._asked.popleft()
            if change.pipeline is not None and change.configuration != self._configuration:
                state = carry_over(change.pipeline, state, self._pipeline.settings)
                self._pipeline, self._configuration = change.pipeline, change.configuration
            self._checkpoint(state, stamp, dropped, new_part=True)
        elif dropped > self._log_dropped and stamp - self._checkpointed >= MEND:
            self._checkpoint(state, stamp, dropped, new_part=False)

        return state

    def _checkpoint(self, state: State, stamp: int, dropped: int, new_part: bool) -> None:
        self._sink.checkpoint(stamp, self._configuration, encode(state), new_part)
        self._log_dropped, self._checkpointed = dropped, stamp

    def _next(self, deadline: int) -> int:
        """The next deadline that has not passed by a whole period; the ones between are missed."""
        skipped = max((self._clock.now() - deadline - self._period) // self._period, 0)
        self.missed += skipped
        return deadline + (skipped + 1) * self._period
