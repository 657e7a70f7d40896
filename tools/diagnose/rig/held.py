"""The learnt discrepancy of a configuration, in the channels of a wheel rig.

Its mean belongs to the prediction. What is left open of it is a covariance between all values: its
directions, the rest that it has where it was learnt, and its prior where it was not.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise

import numpy as np

from gritd.estimator.model.correction import Correction, weights_of
from gritd.estimator.model.discrepancy import conditions_of, features_of
from gritd.estimator.model.learnt import CHANNELS, LearntForm
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import GridRun
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING


class HeldForm:
    """See interface.Held."""

    def __init__(
        self,
        form: LearntForm,
        runs: Sequence[GridRun],
        channels: Sequence[str],
        radius: float,
        lost: Collection[str] = (),
    ) -> None:
        """lost: channels that tell the drive's loss, in which no soil acts."""
        self._correction = Correction(form)
        self._kinds = {
            c: kind for c in channels if c not in lost and (kind := _kind(c)) is not None
        }

        told = [_told(run, radius, self._correction) for run in runs]
        self._conditions = [conditions for conditions, _ in told]
        self._weights = [weights for _, weights in told]

        self._form = form
        self.means: Sequence[Mapping[str, Array]] = [
            self._mean(conditions, weights, channels) for conditions, weights in told
        ]

    def doubts(self, stack: Stack) -> Array:
        """(N, t): see interface.Held."""
        correction = self._correction.at(
            np.vstack(self._conditions), np.vstack(self._weights)
        )  # of all values of all runs, used or not

        parts = [self._placed(stack, {k: correction.columns[:, k] for k in range(len(CHANNELS))})]
        for kind, channel in enumerate(self._form.channels):
            if channel is not None and kind in self._kinds.values():
                columns = self._rest(kind, channel.size, channel.rest)
                parts.append(self._placed(stack, {kind: columns}))

        every = np.hstack(parts)
        return every[:, np.any(every != 0.0, axis=0)]

    def _mean(
        self, conditions: Array, weights: Array, channels: Sequence[str]
    ) -> Mapping[str, Array]:
        mean = self._correction.at(conditions, weights).mean
        none = np.zeros(len(mean))
        return {c: mean[:, self._kinds[c]] if c in self._kinds else none for c in channels}

    def _rest(self, kind: int, size: float, rest: float) -> Array:
        """What no direction holds, of one channel: (n, t) of all values of all runs."""
        conditions, weights = np.vstack(self._conditions), np.vstack(self._weights)[:, kind]
        inside, features = (
            self._correction.inside(conditions),
            self._correction.features(conditions),
        )
        known = self._correction.told(inside, np.sum(features**2, axis=1))
        learnt = rest * inside[:, None] * features

        open_ = np.sqrt(1.0 - known)
        far = (open_ > TUNING.explain.learnt_outside) & (weights != 0.0)
        if not far.any():
            return learnt * (weights * size)[:, None]
        prior = features_of(conditions[far], TUNING.fit.form_features, TUNING.fit.form_left_out)
        outside = np.where(far[:, None], prior.at(conditions) * open_[:, None], 0.0)
        return np.hstack((learnt, outside)) * (weights * size)[:, None]

    def _placed(self, stack: Stack, columns: Mapping[int, Array]) -> Array:
        """Columns (n, t) by kind, of all values of all runs, at the values of the stack (N, t)."""
        count = next(iter(columns.values())).shape[1]
        ends = np.cumsum([0, *(len(run.time) for run in stack.rig.runs)])
        none = np.zeros((int(ends[-1]), count))
        by_channel = {c: columns.get(self._kinds.get(c, -1), none) for c in stack.rig.channels}
        placed = [
            stack.joined([{c: v[a:b, i] for c, v in by_channel.items()} for a, b in pairwise(ends)])
            for i in range(count)
        ]
        return np.column_stack(placed) if placed else np.zeros((stack.size, 0))


def _kind(channel: str) -> int | None:
    """Which δ is a channel's: both torques have the same."""
    name = "torque" if channel == "axle_torque" else channel
    return CHANNELS.index(name) if name in CHANNELS else None


def _told(run: GridRun, radius: float, correction: Correction) -> tuple[Array, Array]:
    """Conditions (n, d) and weights (n, 3) of a run."""
    known = run.covariates
    travel = radius * known["rolled"]
    conditions = conditions_of(
        known["slip"], known["load"], known["speed"], known["direction"], travel, correction.usual
    )
    weights = weights_of(known["load"], known["speed"], known["direction"], correction.usual)
    return conditions, weights
