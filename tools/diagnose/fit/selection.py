"""Forward selection by evidence: of many functions those that together are likeliest, the likeliest
first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import Signature, log_bayes
from gritd.tools.diagnose.fit.projection import Projection
from gritd.tools.diagnose.noise.colour import Noise, whiten
from gritd.tools.diagnose.rig.interface import Index

Tried = Mapping[int, float]  # evidence by number of a part


@dataclass(frozen=True, eq=False)
class Parts:
    """Groups of columns beside a fit. a (m, m), b (m,) of all columns with the fit projected off;
    own: the columns of each part; prior: its log share among all that were tried.
    """

    a: Array
    b: Array
    own: Sequence[Index]
    prior: Sequence[float]

    def evidence(self, taken: Sequence[int]) -> float:
        """Log Bayes factor of some parts together, their choice paid for [nats]."""
        own = np.unique(np.concatenate([self.own[k] for k in taken]))
        bayes = log_bayes(self.a[np.ix_(own, own)], self.b[own], (0,) * own.size)
        return float(bayes) + sum(self.prior[k] for k in taken)

    def gain(self, taken: Sequence[int]) -> float:
        """Nats that some parts, of unit normal weights, gain together beyond what noise alone gives
        them in the mean.
        """
        own = np.unique(np.concatenate([np.zeros(0, dtype=np.intp), *(self.own[k] for k in taken)]))
        a, b = self.a[np.ix_(own, own)], self.b[own]
        known = np.maximum(np.linalg.eigvalsh(a), 0.0)
        noise = 0.5 * float(np.sum(known / (1.0 + known)))
        return max(0.5 * float(b @ np.linalg.solve(a + np.eye(own.size), b)) - noise, 0.0)


def parts_of(
    beside: Projection, noise: Noise, functions: Sequence[Signature], kinds: float = 0.0
) -> Parts:
    """Functions beside a fit. kinds: log of the number of kinds among which they are."""
    columns = np.column_stack([s.columns for s in functions])
    a, b = beside.project(whiten(noise, columns))
    ends = np.cumsum([0, *(s.columns.shape[1] for s in functions)]).tolist()
    own = [np.arange(first, last) for first, last in pairwise(ends)]
    return Parts(a, b, own, [s.prior - kinds for s in functions])


@dataclass
class Taken:
    """Parts in the order in which they were taken up, and what each gained [nats]."""

    parts: list[int] = field(default_factory=list)
    gains: list[float] = field(default_factory=list)

    @property
    def evidence(self) -> float:
        """Of all together."""
        return sum(self.gains)


def likeliest(tried: Tried, slack: float = 0.0) -> int:
    """The part of the largest evidence."""
    return max(tried, key=lambda k: tried[k])


def take_up(
    of: Parts,
    among: Sequence[int],
    most: int,
    least: float = 0.0,
    share: float = 0.0,
    choose: Callable[[Tried, float], int] = likeliest,
) -> Taken:
    """Parts one after the other, while each gains more than `least` and that share of what the ones
    before it have. choose: which is next, of the evidence of each and of what may be given up.
    """
    taken = Taken()
    while len(taken.parts) < min(most, len(among)):
        tried = {k: of.evidence([*taken.parts, k]) for k in among if k not in taken.parts}
        best = choose(tried, max(least, share * max(tried.values())))
        if not taken.parts and tried[best] <= least:  # the plainer one is not enough by itself
            best = likeliest(tried)
        if tried[best] - taken.evidence <= max(least, share * taken.evidence):
            break
        taken.parts.append(best)
        taken.gains.append(tried[best] - taken.evidence)
    return taken
