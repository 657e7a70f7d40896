"""Where a reference campaign tells what this rig does."""

from __future__ import annotations

import numpy as np

from gritd.estimator.model.discrepancy import features_of
from gritd.tools.diagnose.rig.interface import Bools
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING


def covered(stack: Stack) -> Bools:
    """Marks the values (N,) at whose conditions the reference leaves little of δ open; all others
    could be anything that this rig does elsewhere. A wheel that stands is covered as where it drove
    last: its sinkage is from there.
    """
    source = stack.rig.forms[0]
    pairs = list(zip(source.conditions, source.weight, stack.rig.new, strict=True))
    known = np.vstack([c[w != 0.0] for c, w, new in pairs if not new])
    if not known.size:  # next to its new load the reference carried nothing
        return np.zeros(stack.size, bool)
    features = features_of(known, TUNING.fit.form_features, TUNING.fit.form_left_out)

    inside = []
    for conditions, weight, _ in pairs:
        left = 1.0 - np.sum(features.at(conditions) ** 2, axis=1)
        inside.append(_held(left < TUNING.screen.reference_open, weight != 0.0))
    joined = stack.joined([dict.fromkeys(stack.rig.channels, i.astype(float)) for i in inside])
    marks: Bools = joined > 0.5
    return marks


def covered_share(stack: Stack) -> float:
    """Share of what the new campaign drives that the reference covers."""
    asked = stack.new & (stack.covariate("speed") > 0.0)
    return float(np.mean(covered(stack)[asked])) if asked.any() else 0.0


def _held(inside: Bools, driving: Bools) -> Bools:
    """Marks (n,) of one run: where it does not drive those of where it drove last; before that
    all.
    """
    last = np.maximum.accumulate(np.where(driving, np.arange(driving.size), -1))
    held: Bools = np.where(last < 0, True, inside[last])
    return held
