"""What the filter remembers of the run: stretches of steady motion, each merged into one
measurement.

An EKF linearises every measurement once, at the estimate it had then. Where the measurement is
precise and the estimate still poor (k 10 % wrong, one load seen so far) the Jacobians of early
windows point along a valley that later
turns out to lie elsewhere, and the filter keeps the certainty it gained from them: c then comes out
several σ wrong. So the windows are kept, merged as long as the condition stays the same, and
whenever a stretch ends the filter is run again from its anchor over all of them with Jacobians at
the present estimate. This is the iterated extended Kalman smoother (Bell 1994, SIAM J. Optim. 4,
626–636: it is Gauss-Newton on the whole record) with a bounded memory: the oldest stretch is
absorbed into the anchor when there are more than CAPACITY.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from gritd.estimator.filter.estimate import Estimate
from gritd.estimator.wheel.chain import Added, Here
from gritd.estimator.wheel.geometry import EntryAngle, entry_angle
from gritd.estimator.wheel.sync import Measured
from gritd.estimator.wheel.wheel_state import WheelState

CAPACITY = 24  # stretches that are linearised anew
LONGEST = 40  # windows merged into one stretch
STEADY = 3  # windows that make a stretch one of steady motion
SAME_SLIP = 0.02
SAME_LOAD = 0.02  # relative
SAME_ANGLE = 0.02  # relative change of θ₁


class Stretch(NamedTuple):
    """Windows of one condition, merged: the mean state, how many windows, which components were
    accepted.
    """

    mean: WheelState
    windows: int
    components: tuple[int, ...]
    elapsed: float  # [s] since the end of the stretch before

    def holds(self, now: WheelState, components: tuple[int, ...]) -> bool:
        """Whether a window belongs to this stretch."""
        mean = self.mean
        return (
            self.windows < LONGEST
            and components == self.components
            and abs(now.slip.value - mean.slip.value) <= SAME_SLIP
            and abs(now.load.value - mean.load.value) <= SAME_LOAD * mean.load.value
            and abs(now.theta_1.value - mean.theta_1.value) <= SAME_ANGLE * mean.theta_1.value
        )

    def merged(self, now: WheelState, radius: float, elapsed: float) -> Stretch:
        """The stretch with one more window. Sigmas stay those of a single window."""
        weight = 1.0 / (self.windows + 1)
        old = self.mean

        def mean(a: Measured, b: Measured) -> Measured:
            return Measured(a.value + (b.value - a.value) * weight, a.sigma)

        sinkage = mean(old.sinkage, now.sinkage)
        angle: EntryAngle = entry_angle(radius, sinkage.value)
        state = old._replace(
            slip=mean(old.slip, now.slip),
            sinkage=sinkage,
            theta_1=angle,
            theta_m=old.theta_m + (now.theta_m - old.theta_m) * weight,
            torque=mean(old.torque, now.torque),
            load=mean(old.load, now.load),
            drawbar_pull=mean(old.drawbar_pull, now.drawbar_pull),
            added=old.added and now.added and Added(*_blend(old.added, now.added, weight)),
            here=old.here and now.here and Here(*_blend(old.here, now.here, weight)),
            columns=tuple(
                _blend(a, b, weight) for a, b in zip(old.columns, now.columns, strict=True)
            ),
        )
        return Stretch(state, self.windows + 1, self.components, self.elapsed + elapsed)


def _blend(old: tuple[float, ...], now: tuple[float, ...], weight: float) -> Any:
    return tuple([a + (b - a) * weight for a, b in zip(old, now, strict=True)])


class Memory(NamedTuple):
    """The anchor and what came after it; the last stretch is still open."""

    anchor: Estimate
    stretches: tuple[Stretch, ...] = ()
    pending: float = 0.0  # [s] of random walk not yet assigned to a stretch

    def slip_span(self) -> float:
        """Largest difference of slip between steady stretches."""
        slips = [stretch.mean.slip.value for stretch in self.stretches if stretch.windows >= STEADY]
        return max(slips) - min(slips) if slips else 0.0

    def paused(self, elapsed: float) -> Memory:
        """Time passed without an accepted window."""
        return self._replace(pending=self.pending + elapsed)

    def extended(
        self, now: WheelState, components: tuple[int, ...], radius: float, elapsed: float
    ) -> tuple[Memory, bool]:
        """The memory with one more window, and whether a new stretch began."""
        elapsed += self.pending
        if self.stretches and self.stretches[-1].holds(now, components):
            last = self.stretches[-1].merged(now, radius, elapsed)
            return Memory(self.anchor, (*self.stretches[:-1], last)), False
        return Memory(self.anchor, (*self.stretches, Stretch(now, 1, components, elapsed))), True
