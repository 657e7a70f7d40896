"""The readings of one channel on both sides of the horizon, and their mean or slope.

This is the streaming form, in exact integers where a count is concerned. The same means and slopes
from arrays stand in `offline/windows.py`; a test holds the two equal.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import deque
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf, sqrt
from typing import NamedTuple

from gritd.estimator.compiled.arithmetic import total
from gritd.estimator.messages.readings import NS
from gritd.estimator.wheel.geometry import slope_sigma

DITHER = 0.75  # [σ of one reading] between the two values of a sensor that stands still
ENOUGH = 8  # readings in a window without which a dither is not distinguished from noise
SCATTERED = 4  # readings in a window that tell how much they scatter
STEP = 1.0484  # σ of normal readings over the median of their steps
LOUDER = 5.0  # over √n: a thousandth of windows of n readings scatter so much more than they do


class Sample(NamedTuple):
    """A reading inside a channel's window: latency-corrected stamp [ns] and value."""

    stamp: int
    value: float


@dataclass
class Counters:
    """Exact counts since the start of the run."""

    late: int = 0
    duplicates: int = 0
    jumps: int = 0
    invalid: int = 0


class Slope(NamedTuple):
    """The line through a count over the window: its value [raw] at the centre, rate [raw/s] and σ
    of that.
    """

    middle: float
    rate: float
    rate_sigma: float


class Mean(NamedTuple):
    value: float  # raw
    sigma: float  # raw


@dataclass
class ChannelWindow:
    """The readings of one channel, or of one axis of it, on both sides of the horizon.

    noise: standard deviation of one reading [raw]; latency [ns]; length of the window [ns].
    """

    noise: float
    latency: int
    length: int
    pending: list[Sample] = field(default_factory=list)  # newer than the horizon, sorted
    inside: deque[Sample] = field(default_factory=deque)  # within the window, sorted
    closed: int = -1  # end of the last window [ns]; nothing older is accepted
    still_since: int = -1  # stamp since which the value has not left `last` [ns]
    last: float = inf

    def insert(self, stamp: int, value: float, counters: Counters) -> None:
        """Sort one reading in; drop it as late or duplicate, and count that."""
        sample = Sample(stamp - self.latency, value)

        if sample.stamp <= self.closed:
            same = self._has(self.inside, sample.stamp)
            counters.duplicates += same
            counters.late += not same
        elif self.pending and sample.stamp <= self.pending[-1].stamp:
            if self._has(self.pending, sample.stamp):
                counters.duplicates += 1
            else:
                insort(self.pending, sample)
        else:
            self.pending.append(sample)

    @staticmethod
    def _has(samples: list[Sample] | deque[Sample], stamp: int) -> bool:
        place = bisect_left(samples, stamp, key=lambda sample: sample.stamp)
        return place < len(samples) and samples[place].stamp == stamp

    def advance(self, end: int) -> None:
        """Close the window at `end` [ns]: (end − length, end]."""
        self.closed = end
        pending, inside = self.pending, self.inside

        ready = 0
        while ready < len(pending) and pending[ready].stamp <= end:
            self._enter(pending[ready])
            ready += 1
        del pending[:ready]

        start = end - self.length
        while inside and inside[0].stamp <= start:
            self._leave(inside.popleft())

    def _enter(self, sample: Sample) -> None:
        if self._leaves_last(sample.value):
            self.last, self.still_since = sample.value, sample.stamp
        self.inside.append(sample)

    def _leaves_last(self, value: float) -> bool:
        """Whether a value shows that the sensor lives."""
        return value != self.last

    def _leave(self, sample: Sample) -> None:
        """A reading has left the window."""

    def frozen(self, span: int) -> bool:
        """Whether the value has not changed for so long [ns]."""
        return bool(self.inside) and self.closed - self.still_since >= span


def heard(scatter: float, count: int, stated: float) -> float:
    """σ of one reading of so many: the stated one, or what they scatter by where chance hardly
    explains it.
    """
    enough = count >= SCATTERED and scatter > stated * (1.0 + LOUDER / sqrt(count))
    return scatter if enough else stated


class MeanWindow(ChannelWindow):
    """Mean of an analogue channel over the window. Its noise is the stated one, or what the
    readings show where that is more than the stated one explains.

    A sensor that stands still may dither between two values of its converter. It is distinguished
    from a live one by their distance, less than its noise, and by there being no third.
    """

    def _leaves_last(self, value: float) -> bool:
        near = DITHER * self.noise if len(self.inside) >= ENOUGH else 0.0
        return abs(value - self.last) > near

    def frozen(self, span: int) -> bool:
        if not super().frozen(span):
            return False
        values = {sample.value for sample in self.inside}
        return values == {self.last} or (len(values) <= 2 and len(self.inside) >= ENOUGH)

    def mean(self) -> Mean | None:
        values = [sample.value for sample in self.inside]
        if not values:
            return None
        count = len(values)
        noise = heard(STEP * self._step(values), count, self.noise)
        return Mean(total(values) / count, noise / sqrt(count))

    @staticmethod
    def _step(values: list[float]) -> float:
        """Median of the steps from one reading to the next, which a spike leaves as it is."""
        steps = sorted([abs(b - a) for a, b in pairwise(values)])
        at = len(steps) // 2
        return 0.5 * (steps[at] + steps[~at]) if steps else 0.0


@dataclass
class SlopeWindow(ChannelWindow):
    """The least-squares line through an encoder count over the window, by exact integer sums.

    max_rate: fastest believable change [raw/s]. A faster one is a jump of the counter: it is taken
    out by a shift of the baseline, so neither position nor speed shows it. That bridges one jump:
    with a second one in the same window, nothing is known of the speed, and the window begins anew.
    """

    max_rate: float = inf
    counters: Counters = field(default_factory=Counters)
    shift: int = 0  # counts added since the first jump
    # stamp and count the sums are taken about, which keeps the integers short. The stamp is that of
    # the last jump, or of the reading that came into an empty window.
    origin: tuple[int, int] = (0, 0)
    sums: tuple[int, int, int, int, int] = (0, 0, 0, 0, 0)  # Σt, Σx, Σt², Σtx, Σx²

    def _enter(self, sample: Sample) -> None:
        value = int(sample.value) + self.shift
        if self.inside:
            before = self.inside[-1]
            step = value - int(before.value)
            if abs(step) * NS > self.max_rate * (sample.stamp - before.stamp) + 2 * NS:
                lost = step - self._expected_step(sample.stamp - before.stamp)
                self.shift -= lost
                value -= lost
                self.counters.jumps += 1
                self._jumped(sample.stamp)
        if not self.inside:
            self.origin = (sample.stamp, value)
            self.sums = (0, 0, 0, 0, 0)

        super()._enter(Sample(sample.stamp, value))
        self._add(sample.stamp, value, 1)

    def _jumped(self, stamp: int) -> None:
        """The reading of this stamp [ns] has jumped: remember where, or begin anew."""
        if self.inside[0].stamp < self.origin[0]:  # the last jump is still in the window
            self.inside.clear()
            return

        count, later = len(self.inside), stamp - self.origin[0]
        st, sx, stt, stx, sxx = self.sums
        self.origin = (stamp, self.origin[1])
        self.sums = (
            st - count * later,
            sx,
            stt - later * (2 * st - count * later),
            stx - later * sx,
            sxx,
        )

    def _expected_step(self, elapsed: int) -> int:
        """Counts the window's own slope predicts for a time [ns]."""
        slope = self.slope()
        return round(slope.rate * elapsed / NS) if slope else 0

    def _leave(self, sample: Sample) -> None:
        self._add(sample.stamp, int(sample.value), -1)

    def _add(self, stamp: int, value: int, sign: int) -> None:
        t, x = stamp - self.origin[0], value - self.origin[1]
        st, sx, stt, stx, sxx = self.sums
        self.sums = (
            st + sign * t,
            sx + sign * x,
            stt + sign * t * t,
            stx + sign * t * x,
            sxx + sign * x * x,
        )

    def slope(self) -> Slope | None:
        """None until the readings span half the window: a slope over less is not the window's."""
        count = len(self.inside)
        if count < 3 or self.inside[-1].stamp - self.inside[0].stamp < self.length // 2:
            return None
        st, sx, stt, stx, sxx = self.sums
        spread = count * stt - st * st  # count · Σ(t − t̄)² [ns²], exact
        along = count * stx - st * sx
        rate = along / spread * NS
        moved = abs(self.inside[-1].value - self.inside[0].value)
        left = ((count * sxx - sx * sx) * spread - along * along) / (spread * count)
        noise = heard(sqrt(left / (count - 2)), count, self.noise)
        sigma = slope_sigma(noise, sqrt(spread / count) / NS, count, moved)
        return Slope(self.origin[1] + sx / count + rate * self._off_centre(), rate, sigma)

    def _off_centre(self) -> float:
        """[s] from the mean stamp of the readings to the centre of the window."""
        count = len(self.inside)
        centre = self.closed - self.length // 2 - self.origin[0]
        return (count * centre - self.sums[0]) / (count * NS)
