"""What is done with the record where a stretch of motion ends, a share of it a tick.

The stretch becomes a measurement; the record is judged (change.py); where the estimate has moved
from where the memory was linearised, all tangents are taken anew and the filter runs over them
(segments.py says why). That is up to 36 tangents, and as many again where the soil changed: more
than one tick should bear. So each tick does a share. What comes of it takes effect when it is
complete: until then the estimate is the one that the window left. A review is complete before the
next window is used, whatever ticks there were in between: what they left is then done at once. So a
window is always used with the same memory, however many ticks came before it.
"""

from __future__ import annotations

from gritd.estimator.filter.bank import Bank, misfit, reported
from gritd.estimator.filter.bounds import Bounds
from gritd.estimator.filter.estimate import Vector
from gritd.estimator.filter.line import Line
from gritd.estimator.filter.segments import Memory, Stretch
from gritd.estimator.filter.smoother import Smoother
from gritd.estimator.filter.track import (
    Again,
    Ended,
    Judging,
    Passing,
    Relining,
    Task,
    TrackState,
)

# prior standard deviations of the soil, or of the shape of the stresses, after which the memory is
# linearised anew
MOVED = 0.05
UNCHECKED = 40  # windows of one condition in which the tangents are not looked at
ROUNDS = 8  # of linearising a record at its end, at most

# What a tick does. A memory of 36 stretches is judged, linearised and passed in 14 of the 24 ticks
# that lie between two windows at 250 Hz and 10 Hz. A change of the soil takes tangents three times
# over, 36 ticks for a full memory: the rest is then done with the next window.
LINES = 4  # tangents
PASSED = 6  # stretches of a pass, each an update without its tangent


class Reviewer:
    """The settings turned into the steps of a review; what is under way stands in the state."""

    def __init__(self, smoother: Smoother, bounds: Bounds, scales: Vector) -> None:
        self._smoother = smoother
        self._bounds = bounds
        self._scales = scales

    def begun(self, like: bool, unlinearised: int) -> Task:
        """A stretch has ended; like: the next is of the same condition; unlinearised: windows since
        the memory was linearised.
        """
        return Ended(like and unlinearised < UNCHECKED)

    def anew(self, x: Vector) -> Task:
        """The record is to be passed once more, from another anchor."""
        return Relining(x, last=False)

    def finished(self, state: TrackState) -> TrackState:
        """The whole rest of a review at once."""
        while state.task is not None:
            state = self.step(state)
        return state

    def step(self, state: TrackState) -> TrackState:
        """A tick's share of a review that is under way."""
        task = state.task

        if isinstance(task, Ended):
            return self._completed(state, task)
        if isinstance(task, Judging):
            return self._judged(state, task)
        if isinstance(task, Again):
            return self._again(state, task)
        if isinstance(task, Relining):
            return self._relined(state, task)
        return state if task is None else self._passed(state, task)

    def _completed(self, state: TrackState, task: Ended) -> TrackState:
        """The stretch that has ended, compared with the others."""
        memory = self._smoother.completed(state.memory, state.trust.doubt)
        return state._replace(memory=memory, task=Judging(task.same))

    def _judged(self, state: TrackState, task: Judging) -> TrackState:
        """Whether the soil seems to have changed."""
        judgement = self._smoother.judgement(state.memory, state.bank, state.trust.doubt)
        if judgement is None or not judgement.change:
            return self._weighed(state, task.same)

        # tangents taken at a poor estimate mislead: once more, along those at the best fit
        x = self._bounds.inside(state.estimate._replace(x=judgement.x)).x
        return state._replace(task=Again(task.same, x))

    def _again(self, state: TrackState, task: Again) -> TrackState:
        """Judged once more, when all tangents are there."""
        lines = self._more(state.memory, task.x, task.lines)
        if len(lines) < len(state.memory.stretches):
            return state._replace(task=task._replace(lines=lines))

        state = state._replace(memory=state.memory.along(lines), linearised=None)
        judgement = self._smoother.judgement(state.memory, state.bank, state.trust.doubt)
        if judgement is None or not judgement.change:
            return self._weighed(state, task.same)
        memory = state.memory.changed_at(judgement.change, state.bank)
        return self._restarted(state, memory, task.same)

    def _restarted(self, state: TrackState, memory: Memory, same: bool) -> TrackState:
        """The state with a memory in which the soil changed: linearised where the estimate is, and
        once more where that is a new condition and leads far.
        """
        trust, x = state.trust.changed(), state.estimate.x
        return state._replace(memory=memory, trust=trust, task=Relining(x, same))

    def _weighed(self, state: TrackState, same: bool) -> TrackState:
        """On one soil: linearised anew where the condition changes and the estimate has moved."""
        x = state.estimate.x
        if not same and self._moved(state.linearised, x):
            return state._replace(task=Relining(x, last=True))
        return _judged_form(state._replace(task=None))

    def concluded(self, state: TrackState) -> TrackState:
        """The whole record linearised at the estimate that it leads to: what a run leaves. No
        review may be under way.
        """
        if not state.memory.stretches:
            return state
        for _ in range(ROUNDS):
            x = state.estimate.x
            lines = self._smoother.tangents(state.memory.stretches, x)
            state = self._over_all(state, state.memory.along(lines), x)
            if not self._moved(x, state.estimate.x):
                break
        return _judged_form(state)

    def _moved(self, before: Vector | None, now: Vector) -> bool:
        """Whether the estimate is so far from where the memory was linearised that its Jacobians no
        longer serve.
        """
        if before is None:
            return True
        steps = zip(before, now, self._scales, strict=True)
        return any([abs(b - a) > MOVED * scale for a, b, scale in steps])

    def _relined(self, state: TrackState, task: Relining) -> TrackState:
        """More tangents; with all of them, on to the pass."""
        lines = self._more(state.memory, task.x, task.lines)
        if len(lines) < len(state.memory.stretches):
            return state._replace(task=task._replace(lines=lines))
        memory = state.memory.along(lines)
        return state._replace(memory=memory, task=Passing(task.x, task.last, memory.anchor))

    def _more(self, memory: Memory, x: Vector, lines: tuple[Line, ...]) -> tuple[Line, ...]:
        """A share of the tangents at x (3,) more."""
        todo = memory.stretches[len(lines) : len(lines) + LINES]
        return (*lines, *self._smoother.tangents(todo, x))

    def _passed(self, state: TrackState, task: Passing) -> TrackState:
        """The filter over some more of the complete stretches; after the last, over the open one:
        its bank is the state's.
        """
        done, complete = len(task.stretches), len(state.memory.stretches) - 1
        todo = state.memory.stretches[done : min(done + PASSED, complete)]
        stretches, base = self._smoother.over(task.bank, todo, state.trust.doubt)
        stretches = (*task.stretches, *stretches)
        if len(stretches) < complete:
            return state._replace(task=task._replace(bank=base, stretches=stretches))

        state = self._with(state, stretches, base, task.x)._replace(task=None)
        return self._weighed(state, task.last)

    def _over_all(self, state: TrackState, memory: Memory, x: Vector) -> TrackState:
        """The filter over a whole memory that was linearised at x (d,)."""
        *complete, _ = memory.stretches
        stretches, base = self._smoother.over(memory.anchor, complete, state.trust.doubt)
        return self._with(state._replace(memory=memory), stretches, base, x)

    def _with(
        self, state: TrackState, stretches: tuple[Stretch, ...], base: Bank, x: Vector
    ) -> TrackState:
        """The state with what its complete stretches leave, and the open one on top."""
        last = state.memory.stretches[-1:]
        passed, bank = self._smoother.over(base, last, state.trust.doubt)
        bank = self._bounds.all_inside(bank)
        estimate = reported(bank)
        return state._replace(
            estimate=estimate,
            base=base,
            bank=bank,
            memory=state.memory._replace(stretches=(*stretches, *passed)),
            linearised=x,
            unlinearised=0,
            trust=self._bounds.stood(state.trust, estimate),
        )


def _judged_form(state: TrackState) -> TrackState:
    """Whether the equations miss, and where, by a record that was linearised where it leads to."""
    worst = state.memory.farthest(state.bank[0].x)
    place = 0 if worst is None else worst.component
    return state._replace(misfit=misfit(state.bank), misfit_at=place)
