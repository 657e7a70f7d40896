"""The learnt discrepancy of a configuration, in the channels of a wheel rig.

Its mean belongs to the prediction. What is left open of it is a covariance between all values: its
directions, the rest that it has where it was learnt, and its prior where it was not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from gritd.estimator.model.correction import Correction, weights_of
from gritd.estimator.model.discrepancy import features_of
from gritd.estimator.model.learnt import CHANNELS, LearntForm
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.form import conditions_in
from gritd.tools.diagnose.rig.interface import Channels, GridRun, Held
from gritd.tools.diagnose.tuning import TUNING


def held_form(
    form: LearntForm, runs: Sequence[GridRun], channels: Sequence[str], radius: float, lost: bool
) -> Held:
    """What a configuration holds of some runs' channels. lost: whether channel torque tells the
    drive's loss, in which no soil acts.
    """
    correction = Correction(form)
    kinds = {
        c: CHANNELS.index(name)
        for c in channels
        if (name := "torque" if c == "axle_torque" else c) in CHANNELS
        and not (lost and c == "torque")
    }
    usual = correction.usual
    conditions = np.vstack([conditions_in(run, usual, radius) for run in runs])
    known = [run.covariates for run in runs]
    weights = np.vstack(
        [weights_of(of["load"], of["speed"], of["direction"], usual) for of in known]
    )
    at = correction.at(conditions, weights)
    ends = np.cumsum([0, *(run.time.size for run in runs)])

    def placed(columns: Mapping[int, Array]) -> list[Channels]:
        """Values (N,) by kind, of all values of all runs."""
        none = np.zeros(len(conditions))
        every = {c: columns.get(kinds.get(c, -1), none) for c in channels}
        return [{c: values[a:b] for c, values in every.items()} for a, b in pairwise(ends)]

    doubts = [placed(dict(enumerate(column))) for column in at.columns.transpose(2, 1, 0)]
    for kind, channel in enumerate(form.channels):
        if channel is not None and kind in kinds.values():
            rest = _rest(correction, conditions, weights[:, kind], channel.size, channel.rest)
            doubts += [placed({kind: column}) for column in rest.T]
    return Held(placed(dict(enumerate(at.mean.T))), doubts)


def _rest(
    correction: Correction, conditions: Array, weights: Array, size: float, rest: float
) -> Array:
    """What no direction holds, of one channel: (N, t) of all values of all runs."""
    inside, features = correction.inside(conditions), correction.features(conditions)
    known = correction.learnt(inside, np.sum(features**2, axis=1))
    learnt = rest * inside[:, None] * features

    open_ = np.sqrt(1.0 - known)
    far = (open_ > TUNING.explain.learnt_outside) & (weights != 0.0)
    if not far.any():
        return learnt * (weights * size)[:, None]
    prior = features_of(conditions[far], TUNING.fit.form_features, TUNING.fit.form_left_out)
    outside = np.where(far[:, None], prior.at(conditions) * open_[:, None], 0.0)
    return np.hstack((learnt, outside)) * (weights * size)[:, None]
