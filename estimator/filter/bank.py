"""The same record under several sizes of the error of form, weighed by what they foretold.

How far the equations are from a rig is not known before the run (form_error.py). A member of the
bank is the filter with one size of that error. The density that a member gave to what was then
measured is its evidence: where the equations fit, the smallest size foretells best; where they do
not, a larger one does. With little driven, all of them count, and what is reported is as uncertain
as that.

The equations hold where one of the FORM.holding smallest sizes explains the record: what sensors
and arithmetic leave. Beyond, a misfit shows only in part. What c, tan φ, k and the calibrations can
imitate they take for themselves, and of what is left out of the physics that is most. So the size
that is seen is not that of the misfit: where any is seen, what is reported is what the largest size
leaves.
"""

from __future__ import annotations

from math import exp, log

from gritd.estimator.compiled.arithmetic import total
from gritd.estimator.filter.estimate import Estimate, Vector, mixed
from gritd.estimator.filter.tuning import FORM

Bank = tuple[Estimate, ...]  # one a size, in the order of FORM.sizes


def weights(bank: Bank) -> Vector:
    """Probability of each size."""
    scores = [log(odds) + member.log_evidence for odds, member in zip(FORM.odds, bank, strict=True)]
    best = max(scores)
    each = [exp(score - best) for score in scores]
    whole = total(each)
    return tuple([value / whole for value in each])


def reported(bank: Bank) -> Estimate:
    """What the members say together."""
    hold = weights(bank)[: FORM.holding]
    return mixed((*bank[: FORM.holding], bank[-1]), (*hold, 1.0 - total([*hold])))


def leading(bank: Bank) -> int:
    """Number of the most probable member."""
    each = weights(bank)
    return max(range(len(each)), key=each.__getitem__)


def misfit(bank: Bank) -> float:
    """Probability that the equations do not hold."""
    return 1.0 - total([*weights(bank)[: FORM.holding]])
