"""One window after another into c, tan φ and k.

`Tracker.step` takes a state and a snapshot and returns the next state and an account of what was
done. It reads no clock and keeps nothing between calls.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import exp, hypot, log, nan, sqrt
from typing import NamedTuple

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.engine import make_engine
from gritd.estimator.filter.estimate import (
    KPA,
    STATES,
    TAN_PHI,
    C,
    Estimate,
    Update,
    Vector,
    dot,
    predict,
    project,
    variance,
)
from gritd.estimator.filter.measurement import Columns, Measurement, selected, soil
from gritd.estimator.filter.segments import CAPACITY, Memory, Stretch
from gritd.estimator.messages.readings import NS
from gritd.estimator.messages.status import CHANNEL_BITS, Flag, Status
from gritd.estimator.messages.tick import Aid
from gritd.estimator.stages.situation import Recall
from gritd.estimator.wheel.chain import Context
from gritd.estimator.wheel.sync import Snapshot
from gritd.estimator.wheel.wheel_state import REQUIRED_BITS, WheelState, classify

SLIP_VARIES = 0.1  # k is estimated once steady stretches have differed by this much slip …
CLEARLY = 5.0  # … and by this many standard deviations of a window's slip
SEPARABLE = 0.5  # posterior over prior σ in the weakest direction of (c, tan φ)
MOVED = 0.05  # prior standard deviations after which the memory is linearised anew
CONSISTENCY_MEMORY = 2.0  # [s]
# Mean normalised innovation squared above which the filter is reset. A wrong calibration, of the
# size the configuration
# states, gives innovations of variance S that keep their sign for the whole run, so their mean
# square does not settle
# at 1: it exceeds 12 in 1 rig of 1,900 and 4 in 1 of 22 (chi-square, 1 degree of freedom).
INCONSISTENT = 12.0
MISMATCH = 4.0  # … and above which model and measurement are said to disagree
OUTLIER = (
    25.0  # no single window counts for more: a spike is gated, not a reason to forget the soil
)
PATIENCE = 5.0  # [s] after a reset before the next
# [s] a reset so soon after another means that the prior itself is too sure: σ is doubled each time
# …
RELAPSE = 20.0
WIDEST = 6  # … so often


Point = tuple[bool, Vector]  # whether ln k is estimated, and the state


class Account(NamedTuple):
    """What one tick saw and did."""

    snapshot: Snapshot
    now: WheelState
    status: Status
    flags: int  # of Flag
    aids: tuple[Aid, ...]  # empty where nothing was offered to the filter

    @property
    def touching(self) -> bool:
        """Whether the wheel is in the soil, so that there is something to predict."""
        return self.snapshot.ready and self.now.theta_1.value > 0.0


class TrackState(NamedTuple):
    """Everything the tracker remembers from window to window."""

    estimate: Estimate
    memory: Memory
    recall: Mapping[str, Recall]  # what configured effects remember, by name
    columns: Columns = ()  # of the uncertain effect parameters, at the last update
    linearised: Point | None = None  # where the memory was linearised last
    began: int = -1  # end of the first window [ns]
    window_end: int = -1  # end of the last window looked at [ns]
    before: WheelState | None = None
    slip_varied: bool = False  # from one steady stretch to another, since the last reset
    surprise: float = 0.0  # sum of normalised innovations squared, exponentially forgotten
    components: float = 0.0  # number of them, likewise
    last_reset: int = -1
    updates: int = 0
    resets: int = 0
    streak: int = 0  # resets in a row, after the first
    started: bool = False  # every required channel has filled a window once
    origin: float | None = None  # where the carriage stood in the first full window [m]

    @property
    def consistency(self) -> float:
        """Mean normalised innovation squared per component; 1 when the stated noise is the real
        one.
        """
        return self.surprise / self.components if self.components > 0.0 else nan


class Tracker:
    """The settings turned into a filter; the state lives with the caller."""

    def __init__(self, settings: Settings, engine: str | None = None) -> None:
        self.settings = settings
        self.measurement = Measurement(settings)
        self.engine = make_engine(engine or settings.filter.engine, self.measurement.variances)
        self._window = round(NS / settings.rates.update)
        self._required = REQUIRED_BITS | (
            CHANNEL_BITS["wrench"] if settings.wrench is not None else 0
        )
        self._bounds = _bounds(settings)
        soil = settings.soil
        self._prior_sigma = (
            soil.cohesion.sigma / KPA,
            soil.tan_phi.sigma,
            soil.shear_modulus.sigma / soil.shear_modulus.value,
        )

    def start(self) -> TrackState:
        """The prior."""
        soil = self.settings.soil
        estimate = self._unsure(
            (soil.cohesion.value / KPA, soil.tan_phi.value, log(soil.shear_modulus.value))
        )
        return TrackState(estimate, Memory(estimate), self.measurement.chain.fresh_memory())

    def _unsure(self, x: Vector, factor: float = 1.0) -> Estimate:
        """The state x with the prior's standard deviations, times a factor."""
        sigma = tuple([factor * s for s in self._prior_sigma])
        P = tuple(
            tuple(sigma[i] ** 2 if i == j else 0.0 for j in range(STATES)) for i in range(STATES)
        )
        return Estimate(x, P, ((0.0,) * len(self.measurement.variances),) * STATES)

    def step(self, state: TrackState, snapshot: Snapshot) -> tuple[TrackState, Account]:
        """Classify the window; when a whole new one has passed, and it is fit for it, update the
        filter.
        """
        elapsed = 0.0 if state.window_end < 0 else (snapshot.evaluated - state.window_end) / NS
        context = _context(state, snapshot, elapsed)
        now = self.measurement.state(snapshot, context, state.estimate, state.columns)
        status = classify(self.settings, snapshot, now, state.before, self._required, state.started)
        aids: tuple[Aid, ...] = ()
        if state.window_end < 0 or snapshot.evaluated - state.window_end >= self._window:
            state = self._closed(state, snapshot, now, elapsed)
            if status == Status.TRACKING:
                now = self.measurement.with_columns(now, snapshot, context, state.estimate)
                state, aids = self._update(state._replace(columns=now.columns), now, elapsed)
        return state, Account(
            snapshot, now, status, int(now.flags) | self._flags(state, aids), aids
        )

    def _closed(
        self, state: TrackState, snapshot: Snapshot, now: WheelState, elapsed: float
    ) -> TrackState:
        """A window has ended: remember what the next one is compared with, and what the effects
        remember.
        """
        recall = state.recall
        if now.situation is not None:
            recall = self.measurement.chain.remember(recall, elapsed, now.situation)
        return state._replace(
            window_end=snapshot.evaluated,
            began=snapshot.evaluated if state.began < 0 else state.began,
            before=now if snapshot.ready else None,
            recall=recall,
            started=state.started or snapshot.ready,
            origin=snapshot.carriage_position
            if state.origin is None and snapshot.ready
            else state.origin,
        )

    def _update(
        self, state: TrackState, now: WheelState, elapsed: float
    ) -> tuple[TrackState, tuple[Aid, ...]]:
        """Walk over the elapsed time, gate, update, remember, and judge the innovations."""
        state = state._replace(estimate=self._walk(state.estimate, elapsed))
        update = self.measurement.linearise(now, self.measurement.predict(state.estimate, now))
        aids = self._gate(state.estimate, now, update)
        taken = tuple(index for index, aid in enumerate(aids) if aid.accepted)
        if taken:
            estimate = self.engine.update(
                state.estimate, selected(update, taken), not self.estimates_k(state)
            )
            state = state._replace(
                estimate=project(estimate, self._bounds), updates=state.updates + 1
            )
            state = self._remember(state, now, taken, elapsed)
        else:
            state = state._replace(memory=state.memory.paused(elapsed))
        return self._judge(state, aids, elapsed), aids

    def _walk(self, estimate: Estimate, elapsed: float) -> Estimate:
        """Random walk of the soil over the elapsed time [s]."""
        walk = self.settings.filter
        rates = (walk.cohesion_walk / KPA, walk.tan_phi_walk, walk.ln_k_walk)
        return predict(estimate, tuple(rate * rate * elapsed for rate in rates))

    def estimates_k(self, state: TrackState) -> bool:
        """Whether ln k is a state; otherwise it is considered."""
        choice = self.settings.filter.estimate_k
        return choice == "always" or (choice == "auto" and state.slip_varied)

    def _gate(self, estimate: Estimate, now: WheelState, update: Update) -> tuple[Aid, ...]:
        gate, variances = self.settings.filter.gate, self.measurement.variances
        measured = (now.torque.value, now.drawbar_pull.value)
        aids = []
        for index, innovation in enumerate(update.innovation):
            r = update.R[index][index]
            s = variance(estimate, variances, update.H[index], update.G[index]) + r
            ratio = innovation * innovation / (gate * gate * s)
            aids.append(Aid(measured[index], r, innovation, s, ratio, ratio <= 1.0))
        return tuple(aids)

    def _remember(
        self, state: TrackState, now: WheelState, taken: tuple[int, ...], elapsed: float
    ) -> TrackState:
        """Add the window to the memory; when a new stretch begins and the state has moved,
        linearise all anew.
        """
        memory, begun = state.memory.extended(
            now, taken, self.measurement.chain.wheel.radius, elapsed
        )
        if not state.slip_varied and memory.slip_span() > max(
            SLIP_VARIES, CLEARLY * now.slip.sigma
        ):
            state = state._replace(slip_varied=True)
        if not begun or len(memory.stretches) == 1:
            return state._replace(memory=memory)
        if len(memory.stretches) > CAPACITY:
            anchor = self._absorb(memory.anchor, memory.stretches[0], state)
            memory = Memory(anchor, memory.stretches[1:])
        point = (self.estimates_k(state), state.estimate.x)
        if not self._moved(state.linearised, point):
            return state._replace(memory=memory)
        estimate = memory.anchor
        for stretch in memory.stretches:
            estimate = self._absorb(estimate, stretch, state)
        return state._replace(
            memory=memory, estimate=project(estimate, self._bounds), linearised=point
        )

    def _moved(self, before: Point | None, now: Point) -> bool:
        """Whether the state is so far from where the memory was linearised that its Jacobians no
        longer serve.
        """
        if before is None or before[0] != now[0]:
            return True
        steps = zip(before[1], now[1], self._prior_sigma, strict=True)
        return any(abs(b - a) > MOVED * sigma for a, b, sigma in steps)

    def _absorb(self, estimate: Estimate, stretch: Stretch, state: TrackState) -> Estimate:
        """Update with a whole stretch, its Jacobians taken at the present estimate of `state`."""
        estimate = self._walk(estimate, stretch.elapsed)
        prediction = self.measurement.predict(state.estimate, stretch.mean)
        update = selected(self.measurement.linearise(stretch.mean, prediction), stretch.components)
        offset = tuple([x - at for x, at in zip(estimate.x, state.estimate.x, strict=True)])
        merged = Update(
            tuple([y - dot(h, offset) for y, h in zip(update.innovation, update.H, strict=True)]),
            update.H,
            update.G,
            tuple([tuple([r / stretch.windows for r in row]) for row in update.R]),
        )
        return self.engine.update(estimate, merged, not self.estimates_k(state))

    def _judge(self, state: TrackState, aids: tuple[Aid, ...], elapsed: float) -> TrackState:
        """Keep the running consistency figure; back to the prior's covariance, or a wider one, when
        it is out of all measure.
        """
        keep = exp(-elapsed / CONSISTENCY_MEMORY)
        surprise = keep * state.surprise + sum(
            [min(aid.innovation**2 / aid.s, OUTLIER) for aid in aids]
        )
        state = state._replace(surprise=surprise, components=keep * state.components + len(aids))
        rested = state.last_reset < 0 or state.window_end - state.last_reset > PATIENCE * NS
        if not (rested and self._experienced(state) and state.consistency > INCONSISTENT):
            return state
        again = state.last_reset >= 0 and state.window_end - state.last_reset < RELAPSE * NS
        streak = state.streak + 1 if again else 0
        estimate = self._unsure(state.estimate.x, 2.0 ** min(streak, WIDEST))
        return state._replace(
            estimate=estimate,
            memory=Memory(estimate),
            linearised=None,
            slip_varied=False,
            surprise=0.0,
            components=0.0,
            last_reset=state.window_end,
            resets=state.resets + 1,
            streak=streak,
        )

    def _experienced(self, state: TrackState) -> bool:
        """Whether the consistency figure rests on at least half its memory."""
        return state.components > 0.5 * CONSISTENCY_MEMORY * NS / self._window

    def separability(self, estimate: Estimate) -> float:
        """Posterior over prior standard deviation in the weakest direction of (c, tan φ)."""
        sigma_c, sigma_t = self._prior_sigma[C], self._prior_sigma[TAN_PHI]
        if sigma_c == 0.0 or sigma_t == 0.0:
            return 0.0
        P = estimate.P
        a, d = P[C][C] / sigma_c**2, P[TAN_PHI][TAN_PHI] / sigma_t**2
        b = P[C][TAN_PHI] / (sigma_c * sigma_t)
        return sqrt(max(0.5 * (a + d) + hypot(0.5 * (a - d), b), 0.0))

    def _flags(self, state: TrackState, aids: tuple[Aid, ...]) -> int:
        return (
            Flag.NOT_SEPARABLE * (self.separability(state.estimate) > SEPARABLE)
            + Flag.K_ESTIMATED * self.estimates_k(state)
            + Flag.GATED * (not all([aid.accepted for aid in aids]))
            + Flag.RESET * (bool(aids) and state.last_reset == state.window_end)
            + Flag.MISMATCH * (self._experienced(state) and state.consistency > MISMATCH)
        )


def _context(state: TrackState, snapshot: Snapshot, elapsed: float) -> Context:
    """What the effects may know beside the snapshot: time, estimate, rates of change, their memory,
    the start.
    """
    before = state.before
    acceleration = sinking = 0.0
    if before is not None and elapsed > 0.0:
        acceleration = (snapshot.wheel_speed.value - before.read[0]) / elapsed
        sinking = (snapshot.sinkage.value - before.read[1]) / elapsed
    time = 0.0 if state.began < 0 else (snapshot.evaluated - state.began) / NS
    origin = snapshot.carriage_position if state.origin is None else state.origin
    return Context(time, *soil(state.estimate), acceleration, sinking, state.recall, origin)


def _bounds(settings: Settings) -> tuple[tuple[float, float], ...]:
    """Bounds of the scaled state."""
    low_c, high_c = settings.filter.cohesion_bounds
    low_k, high_k = settings.filter.shear_modulus_bounds
    return (low_c / KPA, high_c / KPA), settings.filter.tan_phi_bounds, (log(low_k), log(high_k))
