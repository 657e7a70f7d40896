"""What a rig does when nothing is new: the screen's own test, made in each run of the reference.

A reference that its discrepancy of form does not quite follow shows evidence for anything that acts
in one of its runs alone. The same kind of evidence is no news in the new campaign, and evidence of
another kind is less of it, for the new campaign is driven otherwise. So each candidate is tested in
every run of the reference as it is tested in the new campaign. The alarm counts from the largest
surprise found there of its kind, and must be twice the largest of any kind but ripples. A ripple is
tested in all of these runs together: it may be of one size and phase in all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import logsumexp

from gritd.estimator.effects.base import order_of
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import log_evidence
from gritd.tools.diagnose.fit.projection import Projection
from gritd.tools.diagnose.fit.shape import Candidate
from gritd.tools.diagnose.rig.interface import Bools
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.screen.screen import WhitenedSignature


def habits(
    projection: Projection, everywhere: Sequence[WhitenedSignature], stack: Stack
) -> Mapping[Candidate, float]:
    """Of every candidate the largest log Bayes factor in a single run of the reference, of a ripple
    that in all of its runs.

    everywhere: signatures that act in both campaigns.
    """
    columns = np.column_stack([s.columns for s in everywhere])
    ends = np.cumsum([s.columns.shape[1] for s in everywhere])

    largest: dict[Candidate, float] = {}
    effects = stack.rig.effects
    single = [stack.run == number for number in np.flatnonzero(~np.array(stack.rig.new))]

    for number, rows in enumerate([~stack.new, *single]):
        a, b = _in_run(projection, columns, rows)
        weighed: dict[Candidate, list[float]] = {}
        for s, end in zip(everywhere, ends, strict=True):
            of = s.signature.of
            if number == 0 and not (isinstance(of, str) and order_of(effects[of])):
                continue
            own = slice(end - s.columns.shape[1], end)
            value = float(log_evidence(a[own, own], b[own], s.signature.sign))
            weighed.setdefault(of, []).append(value + s.signature.prior)

        for of, values in weighed.items():
            largest[of] = max(largest.get(of, 0.0), float(logsumexp(values)))
    return largest


def _in_run(projection: Projection, columns: Array, rows: Bools) -> tuple[Array, Array]:
    """A (m, m) and b (m,) of columns (N, m) that act on the marked values alone."""
    projected = projection.project_rows(columns[rows], rows)
    return projected.a, projected.b[:, 0]
