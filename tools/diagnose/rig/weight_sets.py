"""Weights of their own: what hangs on the axle is a set for each load, and each set errs
for itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Index
from gritd.tools.diagnose.tuning import TUNING


@dataclass(frozen=True)
class WeightSets:
    """Loads (m,) of the sets [N]; which of them each value has, per run (n,), −1 for none."""

    loads: tuple[float, ...]
    label: tuple[Index, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"weights_{load:.4g}" for load in self.loads)


def weight_sets(loads: Sequence[Array]) -> WeightSets:
    """The sets in use, from the weights (n,) of each run [N]; none where all runs have the same."""
    values, count = np.unique(np.concatenate(loads), return_counts=True)
    held = values[(count >= TUNING.rig.encoder_readings) & (values > 0.0)]
    sets = np.split(held, np.flatnonzero(np.diff(np.log(held)) > TUNING.rig.least_weights) + 1)
    if not 1 < len(sets) <= TUNING.noise.most_cells:
        none = tuple(np.full(load.size, -1, dtype=np.intp) for load in loads)
        return WeightSets((), none)
    middle = np.array([one.mean() for one in sets])
    return WeightSets(tuple(middle.tolist()), tuple(_nearest(load, middle) for load in loads))


def _nearest(load: Array, middle: Array) -> Index:
    apart = np.abs(load[:, None] / middle - 1.0)
    return np.where(apart.min(axis=1) <= TUNING.rig.least_weights, apart.argmin(axis=1), -1)
