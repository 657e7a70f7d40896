"""The surface of a bed that is prepared anew: no two are alike.

A bed is raked and levelled before a run. What is left of its relief is a smooth function of the
place, part of a millimetre high, and the potentiometer reads it as sinkage. So between a reference
campaign and one on a bed that was prepared anew, each run may have a surface of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import GridRun
from gritd.tools.diagnose.tuning import TUNING


def reliefs_of(
    runs: Sequence[GridRun], channels: Sequence[str], settings: Settings
) -> Iterator[list[Mapping[str, Array]]]:
    """Of each run and each wave of its surface, per run what every channel (n,) reads of it, one
    standard deviation, in the channels' units. Surfaces are as high as `bed.repeatability` states
    it, else as usual.
    """
    if "sinkage" not in channels:
        return
    height = settings.bed.repeatability.surface or TUNING.rig.relief
    nothing: list[Mapping[str, Array]] = [
        {channel: np.zeros(run.time.size) for channel in channels} for run in runs
    ]

    for number, run in enumerate(runs):
        waves = _waves(run.covariates["position"])
        size = height / np.sqrt(np.sum(np.mean(waves**2, axis=0)))
        for wave in waves.T:
            read = {**nothing[number], "sinkage": size * wave}
            yield [*nothing[:number], read, *nothing[number + 1 :]]


def _waves(place: Array) -> Array:
    """Cosines (n, m) over half waves of the way that was driven, from the surface's level on, down
    to the shortest wave that levelling leaves; places (n,) [m].
    """
    way, shortest = float(np.ptp(place)), TUNING.rig.shortest_relief
    count = 1 + min(int(2.0 * way / shortest), TUNING.rig.most_reliefs)
    phase = np.pi * (place - place.min()) / max(way, shortest)
    return np.cos(np.outer(phase, np.arange(count)))
