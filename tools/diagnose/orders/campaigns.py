"""The lines of a campaign, and what of them a reference campaign has already."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import gcd

import numpy as np

from gritd.tools.diagnose.orders.lines import SpectralLine, find_lines, size_in
from gritd.tools.diagnose.orders.stretches import Samples
from gritd.tools.diagnose.tuning import TUNING

Runs = Sequence[Mapping[str, Samples]]


@dataclass(frozen=True)
class Lines:
    """Lines of the new campaign and of the reference, which may be none. aligned: the ripples a
    turn by which the wheel angles of the new runs were aligned (phases.py); 0 where they were not.
    configured: the ripples a turn of what the configuration has already.
    """

    new: tuple[SpectralLine, ...] = ()
    reference: tuple[SpectralLine, ...] = ()
    aligned: float = 0.0
    configured: tuple[float, ...] = ()

    @property
    def every(self) -> tuple[SpectralLine, ...]:
        """Of both campaigns."""
        return (*self.new, *self.reference)

    def of(self, channel: str) -> list[SpectralLine]:
        """All lines of a channel, those of both campaigns once."""
        own = [line for line in self.new if line.channel == channel]
        more = [line for line in self.reference if line.channel == channel]
        return own + [line for line in more if not any(same(line, other) for other in own)]

    def fresh(self, axis: str = "angle") -> list[SpectralLine]:
        """Lines of the new campaign that are no harmonics, that the configuration does not have,
        and that the reference does not have at half their size at least.
        """
        own = (line for line in self.new if line.axis == axis and not line.harmonic)
        own = (line for line in own if not self._configured(line))
        return [x for x in own if self.before(x) <= TUNING.orders.known * x.size]

    def _configured(self, line: SpectralLine) -> bool:
        return line.axis == "angle" and any(abs(line.at - n) < line.cell for n in self.configured)

    def before(self, line: SpectralLine) -> float:
        """Size of a line in the reference. One of few turns may stand there without being found
        among all that are tried.
        """
        return max((x.size for x in self.reference if same(line, x)), default=line.before)

    def shared(self, line: SpectralLine) -> bool:
        """Whether the reference has a line too: found there, or held at half its size."""
        return self.found(line) or line.before > TUNING.orders.known * line.size

    def found(self, line: SpectralLine) -> bool:
        """Whether a line stands out of the reference by itself."""
        return any(same(line, other) for other in self.reference)

    def orders(self, low: float, high: float) -> list[float]:
        """Ripples a turn of the fresh lines between two bounds, each once, the best supported
        first; those far behind it are left out. Then what two of them may be harmonics of, though
        it does not stand out itself: it is slower, so fewer of it were seen.
        """
        standing: list[SpectralLine] = []
        inside = [line for line in self.fresh() if low <= line.at <= high]
        for line in sorted(inside, key=lambda x: (-x.support, x.sigma)):
            least = standing[0].support - TUNING.orders.behind if standing else -np.inf
            if line.support > least and not any(_near(line, other) for other in standing):
                standing.append(line)
        roots = (root for one, other in combinations(inside, 2) for root in _roots(one, other))
        return [*(line.at for line in standing), *sorted({x for x in roots if low <= x})]


NO_LINES = Lines()


def lines_of(new: Runs, reference: Runs = ()) -> Lines:
    """Of the readings of each run at their own rate."""
    found = find_lines(new)
    if not reference:
        return Lines(found)
    of_both = tuple(replace(line, before=size_in(reference, line)) for line in found)
    return Lines(of_both, find_lines(reference))


def same(one: SpectralLine, other: SpectralLine) -> bool:
    """Whether two lines of a channel are one, in two campaigns."""
    return one.channel == other.channel and one.axis == other.axis and _near(one, other)


def _roots(one: SpectralLine, other: SpectralLine) -> list[float]:
    """Ripples a turn of which two lines may be harmonics, as many as a ripple may have besides."""
    lower, upper = sorted((one, other), key=lambda line: line.at)
    numbers = combinations(range(2, TUNING.fit.harmonics + 2), 2)
    return [
        upper.at / over
        for under, over in numbers
        if gcd(under, over) == 1 and _near(_times(lower, over), _times(upper, under))
    ]


def _times(line: SpectralLine, factor: int) -> SpectralLine:
    """A harmonic of a line, as well known as the line tells."""
    return replace(line, at=factor * line.at, sigma=factor * line.sigma)


def _near(one: SpectralLine, other: SpectralLine) -> bool:
    apart = max(one.cell, other.cell)
    doubt = TUNING.rig.doubt * float(np.hypot(one.sigma, other.sigma))
    return abs(one.at - other.at) < max(apart, doubt)
