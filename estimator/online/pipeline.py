"""Readings in, one record a tick out. The daemon, replay and the simulator's checks are thin
callers of `step`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.account import record
from gritd.estimator.filter.pull import UNKNOWN, Pull, Search, searched
from gritd.estimator.filter.tracker import Tracker, TrackState
from gritd.estimator.messages.readings import NS, Reading
from gritd.estimator.messages.record import Flag
from gritd.estimator.wheel.chain import with_latencies
from gritd.estimator.wheel.sync import Sync

MOST = (1 << 32) - 1  # a tick's counters go so far

TickRecord = tuple[float, ...]  # values in the order of record.TICK_FIELDS; times are integer ns


@dataclass(frozen=True)
class State:
    """What one tick leaves for the next. The sync buffers move along with it: a state is stepped
    once.
    """

    sync: Sync
    track: TrackState
    search: Search | None = None  # for the largest drawbar pull
    pull: Pull = UNKNOWN  # as of the last search
    first: int = -1  # time of the first tick [ns]
    late: int = 0
    jumps: int = 0


class Pipeline:
    """The settings compiled once; `start` gives the prior state, `step` the next one."""

    def __init__(self, settings: Settings, engine: str | None = None) -> None:
        self.settings = settings = with_latencies(settings)
        self.tracker = Tracker(settings, engine)
        self._period = NS / settings.rates.tick

    def start(self) -> State:
        return State(Sync(self.settings), self.tracker.start())

    def step(self, state: State, readings: Sequence[Reading], t: int) -> tuple[State, TickRecord]:
        """One tick at time t [ns]. Deterministic: the same states and readings give the same bits."""
        sync = state.sync
        for reading in readings:
            sync.push(reading)
        track, account = self.tracker.step(state.track, sync.snapshot(t))
        search, pull = state.search, state.pull
        if search is not None:
            search, pull = searched(self.tracker.measurement, search, pull)
        elif account.aids:
            search = Search(track.estimate, account.now)
        first = t if state.first < 0 else state.first
        counters = sync.counters
        flags = account.flags
        flags += Flag.LATE_READINGS * (counters.late > state.late) + Flag.COUNTER_JUMP * (
            counters.jumps > state.jumps
        )
        fields = (
            t,
            account.snapshot.evaluated,
            round((t - first) / self._period),
            len(readings),
            int(account.status),
            flags,
            account.snapshot.stale,
            account.snapshot.stuck,
            *(
                min(count, MOST)
                for count in (counters.late, counters.duplicates, counters.jumps, counters.invalid)
            ),
            *record(self.tracker, track, account, pull),
        )
        return State(sync, track, search, pull, first, counters.late, counters.jumps), fields
