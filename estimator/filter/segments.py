"""What the filter remembers of the run: stretches of steady motion, each merged into one
measurement.

An EKF linearises every measurement once, at the estimate it had then. Where the measurement is
precise and the estimate still poor (k 10 % wrong, one load seen so far) the Jacobians of early
windows point along a valley that later turns out to lie elsewhere, and the filter keeps the
certainty it gained from them: c then comes out several σ wrong. So the windows are kept, merged as
long as the condition stays the same, and the filter is run again from its anchor over all of them
with Jacobians at the present estimate. This is the iterated extended Kalman smoother (Bell 1994,
SIAM J. Optim. 4, 626–636: it is Gauss-Newton on the whole record) with a bounded memory. What has
left it keeps the tangents that it had, so as little as may be leaves it: where there are more than
CAPACITY stretches, the oldest neighbours of one condition are joined, and only where there are none
is the oldest stretch absorbed into the anchor.

A stretch is short while it is recent, so that the instant of a change is known to half a second,
and is joined to its neighbour of the same condition as it ages.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, sqrt
from typing import Any, NamedTuple

from gritd.estimator.filter.bank import Bank
from gritd.estimator.filter.estimate import Vector
from gritd.estimator.filter.line import Line
from gritd.estimator.filter.measurement import ByParameters
from gritd.estimator.filter.tuning import CHANGE
from gritd.estimator.messages.replacing import quickly_replaced
from gritd.estimator.wheel.chain import Added, Here
from gritd.estimator.wheel.geometry import EntryAngle, entry_angle
from gritd.estimator.wheel.sync import Measured
from gritd.estimator.wheel.wheel_state import SCATTER, WheelState, slip_over

CAPACITY = 36  # stretches that are linearised anew
SHORTEST = 5  # windows merged into one stretch while it is recent …
LONGEST = 160  # … and at most
AGEING = 4  # a stretch may hold a quarter of the windows that came after it
STEADY = 3  # windows that make a stretch one of steady motion
SAME_SLIP = 0.02
SAME_LOAD = 0.02  # relative
SAME_ANGLE = 0.02  # relative change of θ₁


@quickly_replaced
class Stretch(NamedTuple):
    """Windows of one condition, merged: the mean state, how many windows, which components were
    accepted.
    """

    mean: WheelState
    by_parameters: ByParameters  # likewise the mean
    windows: int
    components: tuple[int, ...]
    elapsed: float  # [s] since the end of the stretch before
    unrest: float = 0.0  # random walk of the soil meanwhile, in prior σ/√s
    line: Line | None = None  # once it is complete
    changed: Bank | None = None  # where the soil changed before it: what is still known then

    @property
    def judged(self) -> bool:
        """Whether it tells of the soil: a window or two are outliers, or part of a transition."""
        return self.windows >= STEADY

    def like(self, other: Stretch) -> bool:
        """Whether another is of the same condition, as far as the noise of both lets that be
        seen.
        """
        mean, now = self.mean, other.mean
        noise = SCATTER * sqrt(1.0 / self.windows + 1.0 / other.windows)
        depths = now.theta_1.d_sinkage * now.sinkage.sigma
        return (
            other.components == self.components
            and abs(now.slip.value - mean.slip.value) <= SAME_SLIP + noise * now.slip.sigma
            and abs(now.load.value - mean.load.value)
            <= SAME_LOAD * mean.load.value + noise * now.load.sigma
            and abs(now.theta_1.value - mean.theta_1.value)
            <= SAME_ANGLE * mean.theta_1.value + noise * depths
        )

    def merged(self, after: Stretch, radius: float) -> Stretch:
        """This stretch and the next, or one more window. Sigmas are those of a single window, in
        the mean square; that of slip is what it would be if the windows were independent.
        """
        windows = self.windows + after.windows
        weight = after.windows / windows
        old, now = self.mean, after.mean

        def mean(a: Measured, b: Measured) -> Measured:
            square = a.sigma * a.sigma + (b.sigma * b.sigma - a.sigma * a.sigma) * weight
            return Measured(a.value + (b.value - a.value) * weight, sqrt(square))

        sinkage = mean(old.sinkage, now.sinkage)
        angle: EntryAngle = entry_angle(radius, sinkage.value)
        both = old.odometry and now.odometry and old.odometry.joined(now.odometry)
        state = old._replace(
            slip=slip_over(both, old) if both else mean(old.slip, now.slip),
            odometry=both,
            sinkage=sinkage,
            theta_1=angle,
            theta_m=old.theta_m + (now.theta_m - old.theta_m) * weight,
            torque=mean(old.torque, now.torque),
            load=mean(old.load, now.load),
            drawbar_pull=mean(old.drawbar_pull, now.drawbar_pull),
            added=old.added and now.added and Added(*_blend(old.added, now.added, weight)),
            here=old.here and now.here and Here(*_blend(old.here, now.here, weight)),
            form=old.form and now.form and old.form.mixed(now.form, weight),
        )
        columns = zip(self.by_parameters, after.by_parameters, strict=True)
        return self._replace(
            mean=state,
            by_parameters=tuple([_blend(a, b, weight) for a, b in columns]),
            windows=windows,
            elapsed=self.elapsed + after.elapsed,
            line=None,
        )

    def joined(self, after: Stretch, radius: float) -> Stretch:
        """This stretch and the next, both complete, as one."""
        assert self.line is not None and after.line is not None
        both = self.merged(after, radius)
        return both._replace(line=self.line.mixed(after.line, after.windows / both.windows))


def _blend(old: tuple[float, ...], now: tuple[float, ...], weight: float) -> Any:
    return tuple([a + (b - a) * weight for a, b in zip(old, now, strict=True)])


class Residual(NamedTuple):
    """What a stretch measured, less what was predicted of it."""

    stretch: Stretch
    component: int  # of those that are measured
    off: float  # [N·m] or [N]


@quickly_replaced
class Memory(NamedTuple):
    """The anchor and what came after it; the last stretch is still open."""

    anchor: Bank
    stretches: tuple[Stretch, ...] = ()
    pending: float = 0.0  # [s] of random walk not yet assigned to a stretch
    closed: bool = False  # whether the last stretch is complete too: another run follows

    @property
    def since(self) -> int:
        """Number of the first stretch after the last change of the soil; 0 without one."""
        changes = [at for at, stretch in enumerate(self.stretches) if stretch.changed is not None]
        return changes[-1] if changes else 0

    def extended(self, window: Stretch, radius: float) -> tuple[Memory, bool]:
        """The memory with one more window, and whether a new stretch began."""
        window = window._replace(elapsed=window.elapsed + self.pending)
        if not self.stretches:
            return self._begun((), window), True

        *before, last = self.stretches
        if not self.closed and last.windows < SHORTEST and last.like(window):
            return self._begun(before, last.merged(window, radius)), False

        if last.judged or self.closed:
            return self._begun(self.stretches, window), True
        return self._begun(before, window._replace(elapsed=window.elapsed + last.elapsed)), True

    def _begun(self, before: Sequence[Stretch], last: Stretch) -> Memory:
        return Memory(self.anchor, (*before, last))

    def farthest(self, x: Vector) -> Residual | None:
        """What is farthest, over its noise, from what a vector x (d,) predicts."""
        worst, largest = None, -1.0
        for stretch in self.stretches:
            if stretch.line is None or not stretch.judged:
                continue
            update = stretch.line.update(x, stretch.windows)
            for at, (off, row) in enumerate(zip(update.innovation, update.R, strict=True)):
                if off * off > largest * row[at]:
                    largest, worst = off * off / row[at], Residual(stretch, at, off)
        return worst

    def dropped(self, after: Memory) -> bool:
        """Whether the last stretch was left out when a new one began: it was too short."""
        return len(after.stretches) == len(self.stretches)

    def without_open(self) -> Memory:
        """The record without its open stretch; the next one is another."""
        if self.closed or not self.stretches:
            return self
        *complete, last = self.stretches
        return Memory(self.anchor, tuple(complete), self.pending + last.elapsed, closed=True)

    def ended(self) -> Memory:
        """The record of a run that is over."""
        return self._replace(closed=True)

    def complete(self) -> tuple[Stretch, ...]:
        """The stretches on the present soil that are complete."""
        return tuple([s for s in self.stretches[self.since : -1] if s.line is not None])

    def along(self, lines: Sequence[Line]) -> Memory:
        """The memory with a tangent for each stretch."""
        both = zip(self.stretches, lines, strict=True)
        return self._replace(stretches=tuple([s._replace(line=line) for s, line in both]))

    def changed_at(self, number: int, known: Bank) -> Memory:
        """The memory with a change of the soil before the complete stretch of this number. What
        failed its gate since then belongs to the new soil, and that may go on changing.
        """
        at, age, since = self.since + number, 0.0, []

        for stretch in self.stretches[at:]:
            measured = tuple(range(len(stretch.line.y))) if stretch.line else stretch.components
            unrest = CHANGE.walk * exp(-age / CHANGE.cooling)
            since.append(stretch._replace(components=measured, unrest=unrest))
            age += stretch.elapsed

        since[0] = since[0]._replace(changed=known)
        return self._replace(stretches=(*self.stretches[:at], *since))

    def crowded(self, radius: float) -> Memory:
        """The memory with the oldest two neighbours joined that are of one condition; the same
        where there are none.
        """
        for at in range(1, len(self.stretches) - 1):
            left, right = self.stretches[at - 1], self.stretches[at]
            if left.windows + right.windows <= LONGEST and _alike(left, right):
                return self._with_joined(at, radius)
        return self

    def aged(self, radius: float) -> Memory:
        """The memory with the latest two neighbours joined that are of one condition and old
        enough.
        """
        after, stretches = 0, self.stretches
        for at in range(len(stretches) - 2, 0, -1):
            left, right = stretches[at - 1], stretches[at]
            allowed = min(LONGEST, after // AGEING)
            if left.windows + right.windows <= allowed and _alike(left, right):
                return self._with_joined(at, radius)
            after += right.windows

        return self

    def _with_joined(self, at: int, radius: float) -> Memory:
        """With the stretch of this number joined to the one before."""
        joined = self.stretches[at - 1].joined(self.stretches[at], radius)
        rest = self.stretches[at + 1 :]
        return self._replace(stretches=(*self.stretches[: at - 1], joined, *rest))


def _alike(left: Stretch, right: Stretch) -> bool:
    return right.changed is None and left.like(right)
