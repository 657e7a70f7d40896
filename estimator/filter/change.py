"""Whether the soil changed: the record explained by one soil, against a change at some instant.

Every stretch of the memory is an affine measurement (line.py) of the soil and of the errors that
all stretches share. Both are the same for all stretches as long as the soil stays what it is. A
wrong calibration moves all stretches together; a change of the soil moves only those after it. With
both Gaussian (the posterior of what came before) and a change drawn from the prior of the soil, the
Bayes factor of "changed before stretch j" against "never changed" has a closed form.

Where nothing changes, a Bayes factor exceeds A in at most 1 of A trials (Ville's inequality), and
the mean time to a false alarm, when a trial begins at every stretch, is at least A stretches
(Pollak 1987, Ann. Statist. 15, 749-779, on the procedure of Shiryaev and Roberts).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gritd.estimator.compiled import arithmetic
from gritd.estimator.filter.estimate import Estimate, Vector
from gritd.estimator.filter.evidence import evidence
from gritd.estimator.filter.line import Line
from gritd.estimator.filter.tuning import CHANGE
from gritd.estimator.terramechanics.soil import Array


class Judgement(NamedTuple):
    """What the record says of s stretches."""

    evidence: Array  # (s,) ln of the Bayes factor of a change before each; the first is not asked
    change: int  # number of the stretch before which the soil changed; 0 where it did not
    x: Vector  # (d,) the vector that fits best if nothing changed


def judge(
    before: Estimate,
    spread: Vector,
    lines: Sequence[Line],
    windows: Sequence[int],
    own: float = 0.0,
) -> Judgement:
    """One soil against a change of it.

    before: what is known ahead of the first line; spread (3,): σ of a change of the soil; lines (s)
    and how many windows each is the mean of; own: the error that each has of its own, in shares of
    the load.
    """
    if arithmetic.BUILT:
        factors, x = arithmetic.evidence(
            before.x, before.packed, spread, list(lines), list(windows), own
        )
    else:
        factors, x = evidence(before, spread, lines, windows, own)

    return Judgement(np.array(factors), _change(factors), x)


def _change(evidence: Vector) -> int:
    """The most probable change, if there is evidence enough for one."""
    if len(evidence) < 2:
        return 0
    best = max(range(1, len(evidence)), key=evidence.__getitem__)
    return best if evidence[best] > CHANGE.alarm else 0
