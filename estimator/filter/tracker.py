"""One window after another into c, tan φ and k.

`Tracker.step` takes a state and a snapshot and returns the next state and an account of what was
done. It reads no clock and keeps nothing between calls.
"""

from __future__ import annotations

from math import hypot, inf, log, sqrt

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.account import Account
from gritd.estimator.filter.bank import Bank, reported
from gritd.estimator.filter.bounds import Bounds
from gritd.estimator.filter.engine import make_engine
from gritd.estimator.filter.estimate import (
    KPA,
    LN_K,
    STATES,
    TAN_PHI,
    C,
    Estimate,
    Update,
    Vector,
    made,
    soil,
    variance,
)
from gritd.estimator.filter.learnt_soil import with_learnt_soil
from gritd.estimator.filter.measurement import Measurement
from gritd.estimator.filter.review import Reviewer
from gritd.estimator.filter.segments import Memory, Stretch
from gritd.estimator.filter.smoother import Smoother
from gritd.estimator.filter.track import Task, TrackState, Withheld
from gritd.estimator.filter.tuning import CHANGE, FORM, TRUST
from gritd.estimator.messages.readings import NS
from gritd.estimator.messages.status import Flag, Status
from gritd.estimator.messages.tick import Aid
from gritd.estimator.wheel.chain import Context
from gritd.estimator.wheel.sync import Snapshot, window_at_first
from gritd.estimator.wheel.wheel_state import (
    WheelState,
    begun_anew,
    classify,
    grain,
    odometry,
    required_bits,
    steady_since,
)

KNOWN = 0.7  # posterior over prior σ of ln k below which the run has determined k
SEPARABLE = 0.5  # posterior over prior σ in the weakest direction of (c, tan φ)


class Tracker:
    """The settings turned into a filter; the state lives with the caller."""

    misfit = FORM.misfit  # probability of an error of form from which on nothing is believed

    def __init__(self, settings: Settings, engine: str | None = None) -> None:
        self.settings = settings
        self.measurement = Measurement(settings)
        self.engine = make_engine(engine or settings.filter.engine)
        self._required = required_bits(settings)
        soil = settings.soil
        self._prior_sigma = (
            soil.cohesion.sigma / KPA,
            soil.tan_phi.sigma,
            soil.shear_modulus.sigma / soil.shear_modulus.value,
        )

        self.prior_bank = self._unsure()
        self.prior = reported(self.prior_bank)
        self._bounds = Bounds(settings, self.prior.x[:STATES], self._prior_sigma)
        self.smoother = Smoother(settings, self.measurement, self.engine, self.prior)
        self.reviewer = Reviewer(self.smoother, self._bounds, self._scales())

    def at_bound(self, estimate: Estimate) -> tuple[int, ...]:
        """Which of c, tan φ and ln k stand at a bound."""
        return self._bounds.reached(estimate)

    def start(self) -> TrackState:
        """The prior."""
        bank = self.prior_bank
        return TrackState(
            self.prior,
            bank,
            bank,
            Memory(bank),
            window_at_first(self.settings),
            self.settings.rates.auto,
            self.measurement.chain.fresh_memory(),
            self.measurement.unmoved,
        )

    def _unsure(self, factor: float = 1.0) -> Bank:
        """The prior, the soil's standard deviations so many times."""
        soil = self.settings.soil
        mean = (soil.cohesion.value / KPA, soil.tan_phi.value, log(soil.shear_modulus.value))
        spread = np.diag(np.square([factor * sigma for sigma in self._prior_sigma]))

        bank = []
        for size in FORM.sizes:
            P = self.measurement.prior(spread, size)
            P = with_learnt_soil(P, self.measurement.learnt_columns, self.settings)
            bank.append(made((*mean, *(0.0,) * (len(P) - STATES)), P))
        return tuple(bank)

    def _scales(self) -> Vector:
        """How far each entry of the vector (d,) may be off before the run; infinite for those that
        the measurements are linear in.
        """
        nonlinear = self.measurement.nonlinear
        P = self.prior.P
        return tuple([sqrt(P[i][i]) if i in nonlinear else inf for i in range(len(P))])

    def step(self, state: TrackState, snapshot: Snapshot) -> tuple[TrackState, Account]:
        """Classify the window; when a whole new one has passed, and it is fit for it, update the
        filter. In the ticks between, a share of what is done with the record.
        """
        elapsed = 0.0 if state.window_end < 0 else (snapshot.evaluated - state.window_end) / NS
        closes = state.window_end < 0 or snapshot.evaluated - state.window_end >= state.window
        if state.task is not None:
            state = self.reviewed(state) if closes else self._concluded(self.reviewer.step(state))

        context = _context(state, snapshot, elapsed)
        now = self.measurement.state(snapshot, context, state.estimate)
        started = state.started
        aids: tuple[Aid, ...] = ()
        if closes and snapshot.ready:
            now = self._counted(now, snapshot, state.window / NS)
        if closes:
            state = self._closed(state, snapshot, now, elapsed)

        status = classify(self.settings, snapshot, now, state.steady, self._required, started)
        if closes and status == Status.TRACKING and not state.choosing:
            known = self.measurement.by_parameters(now, snapshot, context, state.estimate)
            state, aids = self._update(state._replace(by_parameters=known), now, elapsed)

        account = self._account(state, snapshot, now, status, aids)
        if aids and account.flags & Flag.PRIOR:
            state = state._replace(doubted=state.doubted + 1)
        if aids and state.resets != state.resets_flagged:
            state = state._replace(resets_flagged=state.resets)
        return state, account

    def _counted(self, now: WheelState, snapshot: Snapshot, window: float) -> WheelState:
        """A window [s] with what its encoders say of it and of its neighbours together."""
        radius = self.measurement.chain.wheel.radius
        return now._replace(
            grain=grain(self.settings, now, window),
            odometry=odometry(now, snapshot, radius, window),
        )

    def reviewed(self, state: TrackState) -> TrackState:
        """The state with the review that is under way done at once."""
        while state.task is not None:
            state = self._concluded(self.reviewer.finished(state))
        return state

    def concluded(self, state: TrackState) -> TrackState:
        """What the run leaves: its record linearised at the estimate that it leads to."""
        return self.reviewer.concluded(self.reviewed(state))

    def _concluded(self, state: TrackState) -> TrackState:
        """When the review is complete, what the innovations of its window say of the estimate."""
        if state.task is not None or state.withheld is None:
            return state
        aids, elapsed = state.withheld
        first = self.measurement.components[0]
        trust = state.trust.surprised(aids, elapsed / _memory(state), first)
        return self._doubting(self._set_back(state._replace(trust=trust, withheld=None)))

    def _doubting(self, state: TrackState) -> TrackState:
        """Where the equations miss the record, the prior of the soil may have been too sure: the
        same record from a wider one.
        """
        trust = state.trust
        if trust.missing < TRUST.patience or trust.doubts >= TRUST.diverged:
            return state

        trust = trust.reset()._replace(doubts=trust.doubts + 1)
        bank = self._unsure(trust.doubt)
        memory = state.memory._replace(anchor=bank)
        task = self.reviewer.anew(state.estimate.x)
        return state._replace(
            memory=memory, trust=trust, resets=state.resets + 1, task=task, misfit=0.0
        )

    def _account(
        self,
        state: TrackState,
        snapshot: Snapshot,
        now: WheelState,
        status: Status,
        aids: tuple[Aid, ...],
    ) -> Account:
        """What is reported: the filter's estimate where it is believed, else the prior and why."""
        separability = self.separability(state.estimate)
        standing = self.standing(state, separability)
        believed = standing == Status.TRACKING
        shown = separability if believed else 1.0

        return Account(
            snapshot,
            now,
            standing if status == Status.TRACKING else status,
            int(now.flags) | self._flags(state, aids, shown) | Flag.PRIOR * (not believed),
            aids,
            state.estimate if believed else self.prior,
            shown,
        )

    def standing(self, state: TrackState, separability: float) -> Status:
        """TRACKING, or why the estimate is not believed."""
        standing = state.trust.standing(_experienced(state), separability)
        if standing == Status.TRACKING and state.misfit > self.misfit:
            return Status.MISMATCH
        return standing

    def _closed(
        self, state: TrackState, snapshot: Snapshot, now: WheelState, elapsed: float
    ) -> TrackState:
        """A window has ended: remember what the next one is compared with, and what the effects
        remember.
        """
        recall = self.measurement.remember(state.recall, elapsed, now, snapshot)
        steady = steady_since(state.steady, now, snapshot) if snapshot.ready else None
        if begun_anew(state.steady, steady) and not snapshot.stale & self._required:
            state = self._let_go(state)

        return state._replace(
            window_end=snapshot.evaluated,
            began=snapshot.evaluated if state.began < 0 else state.began,
            before=now if snapshot.ready else None,
            steady=steady,
            recall=recall,
            started=state.started or snapshot.ready,
            origin=snapshot.carriage_position
            if state.origin is None and snapshot.ready
            else state.origin,
        )

    def _let_go(self, state: TrackState) -> TrackState:
        """Steady motion has ended, and that shows late: without the stretch that was open."""
        memory = state.memory.without_open()
        if memory is state.memory:
            return state
        return state._replace(memory=memory, bank=state.base, estimate=reported(state.base))

    def _update(
        self, state: TrackState, now: WheelState, elapsed: float
    ) -> tuple[TrackState, tuple[Aid, ...]]:
        """Gate a window, add it to its stretch, and update with the stretch; where one ends, a
        review of the record begins.
        """
        trust = state.trust.passed(elapsed, state.misfit > self.misfit)
        walked = self.smoother.walked(state.estimate, elapsed, trust.unrest)

        prediction = self.measurement.predict(walked, now)
        update = self.measurement.linearise(now, prediction, walked, state.by_parameters)
        aids = self._gate(walked, now, update)
        taken = tuple([index for index, aid in enumerate(aids) if aid.accepted])

        window = Stretch(now, state.by_parameters, 1, taken, elapsed, trust.unrest)
        memory, begun = state.memory.extended(window, self.measurement.chain.wheel.radius)
        base = state.base if not begun or state.memory.dropped(memory) else state.bank
        memory, bank = self.smoother.with_open(memory, base, walked.x, trust.doubt)
        bank = self._bounds.all_inside(bank)
        estimate = reported(bank)
        trust = self._bounds.stood(trust, estimate, elapsed) if taken else trust

        task = self._task(state, window) if begun else None
        state = state._replace(
            estimate=estimate,
            base=base,
            bank=bank,
            memory=memory,
            unlinearised=state.unlinearised + 1,
            trust=trust
            if task
            else trust.surprised(aids, elapsed / _memory(state), self.measurement.components[0]),
            updates=state.updates + bool(taken),
            task=task,
            withheld=None if task is None else Withheld(aids, elapsed),
        )
        return (self._set_back(state) if task is None else state), aids

    def _task(self, state: TrackState, window: Stretch) -> Task | None:
        """The review that begins where a stretch has ended."""
        if not state.memory.stretches:
            return None
        return self.reviewer.begun(state.memory.stretches[-1].like(window), state.unlinearised + 1)

    def _gate(self, estimate: Estimate, now: WheelState, update: Update) -> tuple[Aid, ...]:
        gate = self.settings.filter.gate
        values = (now.torque.value, now.drawbar_pull.value)
        measured = [values[at] for at in self.measurement.components]
        aids = []
        for index, innovation in enumerate(update.innovation):
            r = update.R[index][index]
            s = variance(estimate, update.H[index]) + r
            ratio = innovation * innovation / (gate * gate * s)
            aids.append(Aid(measured[index], r, innovation, s, ratio, ratio <= 1.0))
        return tuple(aids)

    def _set_back(self, state: TrackState) -> TrackState:
        """Back to the prior, or a wider one, when the mean square of the innovations is above the
        reset threshold and no change of the soil explained them.
        """
        if not state.trust.inconsistent(_experienced(state)):
            return state

        trust = state.trust.reset()
        bank = self._unsure(trust.doubt)
        return state._replace(
            estimate=reported(bank),
            base=bank,
            bank=bank,
            memory=Memory(bank),
            linearised=None,
            misfit=0.0,
            trust=trust,
            resets=state.resets + 1,
        )

    def separability(self, estimate: Estimate) -> float:
        """Posterior over prior standard deviation in the weakest direction of (c, tan φ)."""
        sigma_c, sigma_t = self._prior_sigma[C], self._prior_sigma[TAN_PHI]
        if sigma_c == 0.0 or sigma_t == 0.0:
            return 0.0
        P = estimate.soil_P
        a, d = P[C][C] / sigma_c**2, P[TAN_PHI][TAN_PHI] / sigma_t**2
        b = P[C][TAN_PHI] / (sigma_c * sigma_t)
        return sqrt(max(0.5 * (a + d) + hypot(0.5 * (a - d), b), 0.0))

    def _knows_k(self, estimate: Estimate) -> bool:
        """Whether the run has determined k, and not the prior alone."""
        return estimate.soil_P[LN_K][LN_K] < (KNOWN * self._prior_sigma[LN_K]) ** 2

    def _flags(self, state: TrackState, aids: tuple[Aid, ...], separability: float) -> int:
        trust, misses = state.trust, state.misfit > self.misfit
        disagrees = misses or trust.disagrees(_experienced(state))
        torque, drawbar_pull = trust.surprise
        by_pull = torque < drawbar_pull
        if misses:
            by_pull = self.measurement.components[state.misfit_at] == 1

        return (
            Flag.NOT_SEPARABLE * (separability > SEPARABLE)
            + Flag.K_ESTIMATED * self._knows_k(state.estimate)
            + Flag.GATED * (not all([aid.accepted for aid in aids]))
            + Flag.RESET * (bool(aids) and state.resets > state.resets_flagged)
            + Flag.MISMATCH * disagrees
            + Flag.CHANGED * (trust.since_change < CHANGE.settled)
            + Flag.TORQUE_OFF * (disagrees and not by_pull)
            + Flag.DRAWBAR_PULL_OFF * (disagrees and by_pull)
        )


def _experienced(state: TrackState) -> float:
    """Half of what the memory of innovations holds of one component."""
    return 0.5 * _memory(state) * NS / state.window


def _memory(state: TrackState) -> float:
    """[s] over which innovations are averaged."""
    return max(TRUST.memory, TRUST.windows * state.window / NS)


def _context(state: TrackState, snapshot: Snapshot, elapsed: float) -> Context:
    """What the effects may know besides the snapshot: time, estimate, rates of change, their
    memory, the start.
    """
    before = state.before
    acceleration = sinking = 0.0
    if before is not None and elapsed > 0.0:
        acceleration = (snapshot.wheel_speed.value - before.read[0]) / elapsed
        sinking = (snapshot.sinkage.value - before.read[1]) / elapsed

    time = 0.0 if state.began < 0 else (snapshot.evaluated - state.began) / NS
    origin = snapshot.carriage_position if state.origin is None else state.origin
    return Context(time, *soil(state.estimate), acceleration, sinking, state.recall, origin)
