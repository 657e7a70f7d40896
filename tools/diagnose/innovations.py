"""The on-line filter over the same recordings, before and after: is what it says of itself true?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator import batch, config
from estimator.filter.measurement import COMPONENTS
from estimator.recording.salvage import Recording
from estimator.settings import Settings
from tools.diagnose.apply import applied
from tools.diagnose.result import Diagnosis


def with_innovations(
    found: Diagnosis, configuration: config.Configuration, recordings: Sequence[Recording]
) -> Diagnosis:
    """The result with the filter's normalised innovations, by the given configuration and by the improved one."""
    before = innovations(configuration.settings, recordings)
    after = before
    if found.accepted or found.law is not None:
        improved = config.loads(applied(configuration, found), "improved configuration")
        after = innovations(improved.settings, recordings)
    return replace(found, fit=replace(found.fit, innovation_before=before, innovation_after=after))


def innovations(settings: Settings, recordings: Sequence[Recording]) -> dict[str, float]:
    """Root mean square of innovation over its stated standard deviation, per component; 1 where they are true.

    Of updates that were offered, whether accepted or not.
    """
    squares: dict[str, list[float]] = {name: [] for name in COMPONENTS}
    for recording in recordings:
        table = batch.estimates(settings, recording)
        for name in COMPONENTS:
            variance, innovation = table[f"{name}_s"], table[f"{name}_innovation"]
            offered = (variance > 0.0) & np.isfinite(innovation)
            squares[name] += (innovation[offered] ** 2 / variance[offered]).tolist()
    return {name: float(np.sqrt(np.mean(values))) for name, values in squares.items() if values}
