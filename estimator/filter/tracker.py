"""One window after another into c, tan φ and k.

`Tracker.step` takes a state and a snapshot and returns the next state and an account of what was
done. It reads no clock and keeps nothing between calls.
"""

from __future__ import annotations

from math import hypot, log, sqrt
from typing import NamedTuple

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.bounds import Bounds
from gritd.estimator.filter.engine import make_engine
from gritd.estimator.filter.estimate import (
    KPA,
    STATES,
    TAN_PHI,
    C,
    Estimate,
    Update,
    Vector,
    variance,
)
from gritd.estimator.filter.learnt_soil import with_learnt_soil
from gritd.estimator.filter.measurement import Measurement, selected, soil
from gritd.estimator.filter.review import Reviewer
from gritd.estimator.filter.segments import Memory
from gritd.estimator.filter.smoother import Smoother
from gritd.estimator.filter.track import Task, TrackState, Withheld, slip_varies
from gritd.estimator.filter.tuning import CHANGE, TRUST
from gritd.estimator.messages.readings import NS
from gritd.estimator.messages.status import CHANNEL_BITS, Flag, Status
from gritd.estimator.messages.tick import Aid
from gritd.estimator.wheel.chain import Context
from gritd.estimator.wheel.sync import Snapshot
from gritd.estimator.wheel.wheel_state import REQUIRED_BITS, WheelState, classify

SEPARABLE = 0.5  # posterior over prior σ in the weakest direction of (c, tan φ)


class Account(NamedTuple):
    """What one tick saw and did."""

    snapshot: Snapshot
    now: WheelState
    status: Status
    flags: int  # of Flag
    aids: tuple[Aid, ...]  # empty where nothing was offered to the filter
    estimate: Estimate  # what is told: the filter's, or the prior where that is not believed
    separability: float  # of what is told

    @property
    def touching(self) -> bool:
        """Whether the wheel is in the soil, so that there is something to predict."""
        return self.snapshot.ready and self.now.theta_1.value > 0.0


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
        # half of what the memory of innovations holds of one component
        self._experienced = 0.5 * TRUST.memory * NS / self._window
        soil = settings.soil
        self._prior_sigma = (
            soil.cohesion.sigma / KPA,
            soil.tan_phi.sigma,
            soil.shear_modulus.sigma / soil.shear_modulus.value,
        )

        self.prior = with_learnt_soil(
            self._unsure(
                (soil.cohesion.value / KPA, soil.tan_phi.value, log(soil.shear_modulus.value))
            ),
            settings,
        )
        self._bounds = Bounds(settings, self.prior.x, self._prior_sigma)
        self.smoother = Smoother(settings, self.measurement, self.engine, self._prior_sigma)
        self.reviewer = Reviewer(settings, self.smoother, self._bounds)

    def start(self) -> TrackState:
        """The prior."""
        return TrackState(self.prior, Memory(self.prior), self.measurement.chain.fresh_memory())

    def _unsure(self, x: Vector, factor: float = 1.0) -> Estimate:
        """The state x with the prior's standard deviations, times a factor."""
        sigma = tuple([factor * s for s in self._prior_sigma])
        P = tuple(
            tuple(sigma[i] ** 2 if i == j else 0.0 for j in range(STATES)) for i in range(STATES)
        )
        return Estimate(x, P, ((0.0,) * len(self.measurement.variances),) * STATES)

    def step(self, state: TrackState, snapshot: Snapshot) -> tuple[TrackState, Account]:
        """Classify the window; when a whole new one has passed, and it is fit for it, update the
        filter. In the ticks between, a share of what is done with the record.
        """
        elapsed = 0.0 if state.window_end < 0 else (snapshot.evaluated - state.window_end) / NS
        closes = state.window_end < 0 or snapshot.evaluated - state.window_end >= self._window
        if state.task is not None:
            state = self.reviewed(state) if closes else self._concluded(self.reviewer.step(state))

        context = _context(state, snapshot, elapsed)
        now = self.measurement.state(snapshot, context, state.estimate, state.columns)
        status = classify(self.settings, snapshot, now, state.before, self._required, state.started)
        aids: tuple[Aid, ...] = ()
        if closes:
            state = self._closed(state, snapshot, now, elapsed)
            if status == Status.TRACKING:
                now = self.measurement.with_columns(now, snapshot, context, state.estimate)
                state, aids = self._update(state, now, elapsed)

        account = self._account(state, snapshot, now, status, aids)
        if aids and state.resets != state.resets_told:
            state = state._replace(resets_told=state.resets)
        return state, account

    def reviewed(self, state: TrackState) -> TrackState:
        """The state with the review that is under way done at once."""
        return self._concluded(self.reviewer.finished(state))

    def _concluded(self, state: TrackState) -> TrackState:
        """When the review is complete, what the innovations of its window say of the estimate."""
        if state.task is not None or state.withheld is None:
            return state
        trust = state.trust.surprised(*state.withheld)
        return self._set_back(state._replace(trust=trust, withheld=None))

    def _account(
        self,
        state: TrackState,
        snapshot: Snapshot,
        now: WheelState,
        status: Status,
        aids: tuple[Aid, ...],
    ) -> Account:
        """What is told: the filter's estimate where it is believed, else the prior and why."""
        separability = self.separability(state.estimate)
        standing = state.trust.standing(self._experienced, separability)
        believed = standing == Status.TRACKING
        told = separability if believed else 1.0

        return Account(
            snapshot,
            now,
            standing if status == Status.TRACKING else status,
            int(now.flags) | self._flags(state, aids, told) | Flag.PRIOR * (not believed),
            aids,
            state.estimate if believed else self.prior,
            told,
        )

    def _closed(
        self, state: TrackState, snapshot: Snapshot, now: WheelState, elapsed: float
    ) -> TrackState:
        """A window has ended: remember what the next one is compared with, and what the effects
        remember.
        """
        recall = self.measurement.remember(state.recall, elapsed, now, snapshot)

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
        """Walk over the elapsed time, gate, update, remember; where a stretch ends, begin a review
        of the record.
        """
        trust = state.trust.passed(elapsed)
        walked = self.smoother.walked(state.estimate, elapsed, trust.unrest)

        update = self.measurement.linearise(now, self.measurement.predict(walked, now))
        aids = self._gate(walked, now, update)
        taken = tuple([index for index, aid in enumerate(aids) if aid.accepted])
        estimate = walked
        if taken:
            update = selected(update, taken)
            estimate = self.engine.update(walked, update, not self.reviewer.estimates_k(state))
            estimate = self._bounds.inside(estimate)
            trust = self._bounds.stood(trust, estimate, elapsed)

        memory, task = self._remembered(state, now, taken, elapsed, trust.unrest)
        state = state._replace(
            estimate=estimate,
            columns=now.columns,
            memory=memory,
            slip_varied=state.slip_varied or slip_varies(memory, now.slip.sigma),
            unlinearised=state.unlinearised + 1,
            trust=trust.surprised(aids, elapsed) if task is None else trust,
            updates=state.updates + bool(taken),
            task=task,
            withheld=None if task is None else Withheld(aids, elapsed),
        )
        return (self._set_back(state) if task is None else state), aids

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

    def _remembered(
        self,
        state: TrackState,
        now: WheelState,
        taken: tuple[int, ...],
        elapsed: float,
        unrest: float,
    ) -> tuple[Memory, Task | None]:
        """The memory with one more window; where a stretch ends, a review of the record begins."""
        radius, before = self.measurement.chain.wheel.radius, state.memory.stretches[-1:]
        memory, begun = state.memory.extended(now, taken, radius, elapsed, unrest)

        if not begun or not before:
            return memory, None
        return memory, self.reviewer.begun(before[0].like(now, taken), state.unlinearised + 1)

    def _set_back(self, state: TrackState) -> TrackState:
        """Back to the prior's covariance, or a wider one, when the innovations were out of all
        measure and no change of the soil explained them. From a bound, back to its mean as well.
        """
        if not state.trust.inconsistent(self._experienced):
            return state

        trust = state.trust.reset()
        x = self.prior.x if self._bounds.improbable(state.estimate) else state.estimate.x
        estimate = self._unsure(x, trust.doubt)
        return state._replace(
            estimate=estimate,
            memory=Memory(estimate),
            linearised=None,
            slip_varied=False,
            trust=trust,
            resets=state.resets + 1,
        )

    def separability(self, estimate: Estimate) -> float:
        """Posterior over prior standard deviation in the weakest direction of (c, tan φ)."""
        sigma_c, sigma_t = self._prior_sigma[C], self._prior_sigma[TAN_PHI]
        if sigma_c == 0.0 or sigma_t == 0.0:
            return 0.0
        P = estimate.P
        a, d = P[C][C] / sigma_c**2, P[TAN_PHI][TAN_PHI] / sigma_t**2
        b = P[C][TAN_PHI] / (sigma_c * sigma_t)
        return sqrt(max(0.5 * (a + d) + hypot(0.5 * (a - d), b), 0.0))

    def _flags(self, state: TrackState, aids: tuple[Aid, ...], separability: float) -> int:
        trust = state.trust
        disagrees = trust.disagrees(self._experienced)
        torque, drawbar_pull = trust.surprise

        return (
            Flag.NOT_SEPARABLE * (separability > SEPARABLE)
            + Flag.K_ESTIMATED * self.reviewer.estimates_k(state)
            + Flag.GATED * (not all([aid.accepted for aid in aids]))
            + Flag.RESET * (bool(aids) and state.resets > state.resets_told)
            + Flag.MISMATCH * disagrees
            + Flag.CHANGED * (trust.since_change < CHANGE.settled)
            + Flag.TORQUE_OFF * (disagrees and torque >= drawbar_pull)
            + Flag.DRAWBAR_PULL_OFF * (disagrees and torque < drawbar_pull)
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
