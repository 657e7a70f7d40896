"""Readings in, one record a tick out. The daemon, replay and the simulator's checks are thin
callers of `step`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.account import (
    Account,
    aids,
    health,
    measurements,
    predictions,
    soil_estimate,
)
from gritd.estimator.filter.pull import UNKNOWN, Pull, Search, search_on
from gritd.estimator.filter.track import TrackState
from gritd.estimator.filter.tracker import Tracker
from gritd.estimator.messages.readings import NS, Reading
from gritd.estimator.messages.status import Flag
from gritd.estimator.messages.tick import Head, LargestPull, Tick, TickRow, row
from gritd.estimator.wheel.chain import with_latencies
from gritd.estimator.wheel.sync import Snapshot, Sync
from gritd.estimator.wheel.window_choice import driving, window_of

MOST = (1 << 32) - 1  # a tick's counters go so far


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
    driven: Snapshot | None = None  # the last window, while its length is being chosen


class Pipeline:
    """The settings compiled once; `start` gives the prior state, `step` the next one."""

    def __init__(self, settings: Settings, engine: str | None = None) -> None:
        self.settings = settings = with_latencies(settings)
        self.tracker = Tracker(settings, engine)
        self._period = NS / settings.rates.tick

    def start(self) -> State:
        return State(Sync(self.settings), self.tracker.start())

    def step(self, state: State, readings: Sequence[Reading], t: int) -> tuple[State, TickRow]:
        """One tick at time t [ns]. Deterministic: the same states and readings give the same
        bits.
        """
        sync = state.sync
        for reading in readings:
            sync.push(reading)

        track, account = self.tracker.step(state.track, sync.snapshot(t))
        driven = state.driven
        if track.choosing and track.window_end == account.snapshot.evaluated:
            track, driven = self._chosen(sync, track, account.snapshot, driven)

        search, pull = state.search, state.pull
        if search is not None:
            search, pull = search_on(self.tracker.measurement, search, pull)
        elif account.aids:
            search = Search(account.estimate, account.now, track.by_parameters)

        first = t if state.first < 0 else state.first
        late, jumps = sync.counters.late, sync.counters.jumps
        after = State(sync, track, search, pull, first, late, jumps, driven)
        return after, row(self._tick(state, after, account, len(readings), t))

    def _chosen(
        self, sync: Sync, track: TrackState, now: Snapshot, before: Snapshot | None
    ) -> tuple[TrackState, Snapshot | None]:
        """The length of the windows, once wheel and carriage drive."""
        if not driving(now, before):
            return track, now
        sync.resize(window_of(self.settings, now, sync.samples()))
        return track._replace(window=sync.length, choosing=False), None

    def _tick(self, before: State, after: State, account: Account, consumed: int, t: int) -> Tick:
        """What the tick at t [ns] says."""
        torque, drawbar_pull = aids(account)

        return Tick(
            head=self._head(before, after, account, consumed, t),
            measurements=measurements(account.snapshot, account.now),
            soil=soil_estimate(account.estimate),
            predictions=predictions(self.tracker.measurement, after.track, account),
            largest_pull=LargestPull(*after.pull),
            health=health(after.track, account),
            torque=torque,
            drawbar_pull=drawbar_pull,
        )

    def _head(self, before: State, after: State, account: Account, consumed: int, t: int) -> Head:
        """When the tick was and what came in; to the tracker's flags those of the readings."""
        counters, snapshot = after.sync.counters, account.snapshot
        flags = account.flags
        flags += Flag.LATE_READINGS * (after.late > before.late)
        flags += Flag.COUNTER_JUMP * (after.jumps > before.jumps)

        return Head(
            stamp=t,
            evaluated=snapshot.evaluated,
            sequence=round((t - after.first) / self._period),
            consumed=consumed,
            status=int(account.status),
            flags=flags,
            stale=snapshot.stale,
            stuck=snapshot.stuck,
            late=min(counters.late, MOST),
            duplicates=min(counters.duplicates, MOST),
            jumps=min(counters.jumps, MOST),
            invalid=min(counters.invalid, MOST),
        )
