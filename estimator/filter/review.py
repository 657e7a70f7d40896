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

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.bounds import Bounds
from gritd.estimator.filter.estimate import Vector
from gritd.estimator.filter.line import Line
from gritd.estimator.filter.segments import LONGEST, Memory
from gritd.estimator.filter.smoother import Smoother
from gritd.estimator.filter.track import (
    Again,
    Ended,
    Judging,
    Passing,
    Point,
    Relining,
    Task,
    TrackState,
    slip_varies,
)

MOVED = 0.05  # prior standard deviations after which the memory is linearised anew

# What a tick does. A memory of 36 stretches is judged, linearised and passed in 14 of the 24 ticks
# that lie between two windows at 250 Hz and 10 Hz. A change of the soil takes tangents three times
# over, 36 ticks for a full memory: the rest is then done with the next window.
LINES = 4  # tangents
PASSED = 12  # stretches of a pass, each an update without its tangent


class Reviewer:
    """The settings turned into the steps of a review; what is under way stands in the state."""

    def __init__(self, settings: Settings, smoother: Smoother, bounds: Bounds) -> None:
        self._choice = settings.filter.estimate_k
        self._smoother = smoother
        self._bounds = bounds

    def estimates_k(self, state: TrackState) -> bool:
        """Whether ln k is a state; otherwise it is considered."""
        return self._choice == "always" or (self._choice == "auto" and state.slip_varied)

    def begun(self, like: bool, unlinearised: int) -> Task:
        """A stretch has ended; like: the next is of the same condition; unlinearised: windows since
        the memory was linearised.
        """
        return Ended(like and unlinearised < LONGEST)

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
        """The stretch that has ended as a measurement."""
        considered, doubt = not self.estimates_k(state), state.trust.doubt
        memory = self._smoother.completed(state.memory, state.estimate.x, considered, doubt)
        return state._replace(memory=memory, task=Judging(task.same))

    def _judged(self, state: TrackState, task: Judging) -> TrackState:
        """Whether the soil seems to have changed."""
        judgement = self._smoother.judgement(state.memory, state.trust.doubt)
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
        judgement = self._smoother.judgement(state.memory, state.trust.doubt)
        if judgement is None or not judgement.change:
            return self._weighed(state, task.same)
        memory = state.memory.changed_at(judgement.change, state.estimate)
        return self._restarted(state, memory, task.same)

    def _restarted(self, state: TrackState, memory: Memory, same: bool) -> TrackState:
        """The state with a memory in which the soil changed: linearised where the estimate is, and
        once more where that is a new condition and leads far.
        """
        before = state.before
        varied = before is not None and slip_varies(memory, before.slip.sigma)
        state = state._replace(memory=memory, slip_varied=varied)
        point = (self.estimates_k(state), state.estimate.x)
        return state._replace(trust=state.trust.changed(), task=Relining(point, same))

    def _weighed(self, state: TrackState, same: bool) -> TrackState:
        """On one soil: linearised anew where the condition changes and the estimate has moved."""
        point = (self.estimates_k(state), state.estimate.x)
        anew = not same and self._moved(state.linearised, point)
        return state._replace(task=Relining(point, last=True) if anew else None)

    def _moved(self, before: Point | None, now: Point) -> bool:
        """Whether the state is so far from where the memory was linearised that its Jacobians no
        longer serve.
        """
        if before is None or before[0] != now[0]:
            return True
        steps = zip(before[1], now[1], self._smoother.prior_sigma, strict=True)
        return any(abs(b - a) > MOVED * sigma for a, b, sigma in steps)

    def _relined(self, state: TrackState, task: Relining) -> TrackState:
        """More tangents; with all of them, on to the pass."""
        lines = self._more(state.memory, task.point[1], task.lines)
        if len(lines) < len(state.memory.stretches):
            return state._replace(task=task._replace(lines=lines))
        memory = state.memory.along(lines)
        return state._replace(memory=memory, task=Passing(task.point, task.last, memory.anchor))

    def _more(self, memory: Memory, x: Vector, lines: tuple[Line, ...]) -> tuple[Line, ...]:
        """A share of the tangents at x (3,) more."""
        todo = memory.stretches[len(lines) : len(lines) + LINES]
        return (*lines, *self._smoother.tangents(todo, x))

    def _passed(self, state: TrackState, task: Passing) -> TrackState:
        """The filter over some more stretches; over the last, its estimate is the state's."""
        done = len(task.stretches)
        todo = state.memory.stretches[done : done + PASSED]
        stretches, estimate = self._smoother.over(
            task.estimate, todo, not task.point[0], state.trust.doubt
        )
        stretches = (*task.stretches, *stretches)
        if len(stretches) < len(state.memory.stretches):
            return state._replace(task=task._replace(estimate=estimate, stretches=stretches))

        memory = state.memory._replace(stretches=stretches)
        estimate = self._bounds.inside(estimate)
        state = state._replace(
            estimate=estimate,
            memory=memory,
            linearised=task.point,
            unlinearised=0,
            trust=self._bounds.stood(state.trust, estimate),
            task=None,
        )
        return self._weighed(state, task.last)
