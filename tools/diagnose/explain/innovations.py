"""The on-line filter over the same recordings, before and after: is what it says of itself true?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.measurement import COMPONENTS
from gritd.estimator.offline import batch
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.salvage import Recording
from gritd.tools.diagnose.explain.apply import applied
from gritd.tools.diagnose.explain.result import Diagnosis

NO_FILTER = "A drive without soil: no on-line filter runs over it."
NO_UPDATE = (
    "The on-line filter was offered no update: torque, load or motion are missing, or the wheel"
    " never settled."
)
NOTHING_NEW = "Nothing was accepted, so the on-line filter stays as it is."


def with_innovations(
    diagnosis: Diagnosis,
    configuration: config.Configuration,
    recordings: Sequence[Recording],
    soil: bool = True,
) -> Diagnosis:
    """The result with the filter's normalised innovations by the given configuration and by the
    improved one.

    Where there are none, or no improved one, `innovation_note` says why.
    """
    if not soil:
        return _noted(diagnosis, NO_FILTER)

    try:
        before = innovations(configuration.settings, recordings)
        if not before:
            return _noted(diagnosis, NO_UPDATE)
        if not diagnosis.accepted and diagnosis.law is None:
            return _noted(diagnosis, NOTHING_NEW, before, before)

        improved = config.loads(applied(configuration, diagnosis), "improved configuration")
        return _noted(diagnosis, "", before, innovations(improved.settings, recordings))
    except (RecordingError, config.ConfigError) as error:
        return _noted(diagnosis, f"The on-line filter could not run: {error}.")


def _noted(
    diagnosis: Diagnosis,
    note: str,
    before: dict[str, float] | None = None,
    after: dict[str, float] | None = None,
) -> Diagnosis:
    fit = replace(
        diagnosis.fit, innovation_before=before, innovation_after=after, innovation_note=note
    )
    return replace(diagnosis, fit=fit)


def innovations(settings: Settings, recordings: Sequence[Recording]) -> dict[str, float]:
    """Root mean square of innovation over its stated standard deviation, per component; 1 where
    they are true.

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
