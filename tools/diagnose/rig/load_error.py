"""What of a measured load may be error and not load.

Where some run does not state its weights, the force sensor tells them, with noise. A prediction
that is driven by a measured load has that noise in it, and what was measured does not follow it
(errors in variables: Fuller 1987, Measurement Error Models, ch. 1). Three things are left to every
fit: how much of the load's quick changes are noise, how much of its slow ones, and by how much the
mean of each run is off.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.ndimage import median_filter

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.weights import Weights
from gritd.tools.diagnose.tuning import TUNING

Channels = Mapping[str, Array]


def load_errors_in(
    weights: Sequence[Weights], by_load: Sequence[Channels]
) -> list[list[dict[str, Array]]]:
    """Of each error, per run, what every channel (n,) is predicted too low by if it is there.

    by_load: per run, change of every channel (n,) by ln of the load.
    """
    changes = [
        changes_of(one.values) if one.load is not None else (0.0 * one.values, 0.0 * one.values)
        for one in weights
    ]

    shared = [
        [_moved(by, -part) for by, part in zip(by_load, parts, strict=True)]
        for parts in zip(*changes, strict=True)
    ]
    own = [
        [
            _moved(by, error_of_level(one.load) * float(run == number))
            for run, by in enumerate(by_load)
        ]
        for number, one in enumerate(weights)
        if one.load is not None
    ]

    return [*shared, *own] if own else []


def changes_of(load: Array) -> tuple[Array, Array]:
    """Relative changes (n,) of a load (n,) that may be noise: quick ones beside its neighbours, and
    slow ones beside the run's level; 0 where other weights hang on the axle, or none.
    """
    level = _level(load)
    near = np.abs(load - level) <= TUNING.rig.other_weights * level
    logarithm = np.log(np.where(near, load, level))
    slow = median_filter(logarithm, TUNING.rig.unrest_values, mode="nearest")
    quick = np.where(near, logarithm - slow, 0.0)
    return quick, np.where(near, slow - np.log(level), 0.0)


def error_of_level(load: Array) -> float:
    """Relative standard deviation of a run's mean load from a measured load (n,), whatever the
    colour of its noise: by the means of parts of the run.
    """
    level = _level(load)
    near = load[np.abs(load - level) <= TUNING.rig.other_weights * level]
    if near.size < TUNING.rig.load_parts:
        return 0.0
    means = [float(part.mean()) for part in np.array_split(near, TUNING.rig.load_parts)]
    return float(np.std(means, ddof=1) / np.sqrt(len(means))) / level


def _level(load: Array) -> float:
    """Median while the wheel carries."""
    return float(np.median(load[load > TUNING.rig.lifted * load.max()]))


def _moved(by_load: Channels, part: Array | float) -> dict[str, Array]:
    return {channel: change * part for channel, change in by_load.items()}
