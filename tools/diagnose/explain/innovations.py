"""The on-line filter over the same recordings, before and after: is what it says of itself true?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.measurement import COMPONENTS
from gritd.estimator.offline import batch
from gritd.estimator.recording.mcapfile import RecordingError
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.parallel import each
from gritd.tools.diagnose.explain.apply import applied
from gritd.tools.diagnose.explain.result import Diagnosis

NO_FILTER = "A drive without soil: no on-line filter runs over it."
NO_UPDATE = (
    "The on-line filter was offered no update: torque, load or motion are missing, or the wheel"
    " never settled."
)
NOTHING_NEW = "Nothing was accepted, so the on-line filter stays as it is."


@dataclass(frozen=True)
class Filtered:
    """Root mean square of the filter's normalised innovations, per component; `note` says why there
    is none.
    """

    innovations: dict[str, float] | None = None
    note: str = ""


def filtered(
    settings: Settings, reads: Sequence[Callable[[], Recording]], soil: bool, jobs: int = 1
) -> Filtered:
    """By a configuration. reads: give a recording each; soil: whether the rig has any; jobs:
    processes.
    """
    if not soil:
        return Filtered(note=NO_FILTER)
    try:
        ratios = innovations(settings, reads, jobs)
    except RecordingError as error:
        return Filtered(note=_failed(error))
    return Filtered(ratios) if ratios else Filtered(note=NO_UPDATE)


def with_innovations(
    diagnosis: Diagnosis,
    configuration: config.Configuration,
    before: Filtered,
    reads: Sequence[Callable[[], Recording]],
    jobs: int = 1,
) -> Diagnosis:
    """The result with the filter's normalised innovations by the given configuration, `before`, and
    by the improved one; jobs: processes.

    reads: give a recording each, called only where there is an improved one. Where there is none
    `innovation_note` says why.
    """
    after = before
    if before.innovations is not None:
        after = Filtered(before.innovations, NOTHING_NEW)
        if diagnosis.accepted or diagnosis.law is not None:
            try:
                improved = config.loads(applied(configuration, diagnosis), "improved configuration")
                after = filtered(improved.settings, reads, True, jobs)
            except config.ConfigError as error:
                after = Filtered(note=_failed(error))

    compared = before.innovations if after.innovations else None
    fit = replace(
        diagnosis.fit,
        innovation_before=compared,
        innovation_after=after.innovations,
        innovation_note=after.note,
    )
    return replace(diagnosis, fit=fit)


def _failed(error: Exception) -> str:
    return f"The on-line filter could not run: {error}."


def innovations(
    settings: Settings, reads: Sequence[Callable[[], Recording]], jobs: int = 1
) -> dict[str, float]:
    """Root mean square of innovation over its stated standard deviation, per component; 1 where
    they are true. reads: give a recording each; jobs: processes.

    Of updates that were offered, whether accepted or not.
    """
    each_run = each(jobs, lambda read: _squares(settings, read()), reads)
    joined = {name: np.concatenate([one[name] for one in each_run]) for name in COMPONENTS}
    return {name: float(np.sqrt(np.mean(values))) for name, values in joined.items() if values.size}


def _squares(settings: Settings, recording: Recording) -> dict[str, Array]:
    """Squared innovation over its variance at every update of one recording (n,), per component."""
    table, squares = batch.estimates(settings, recording), {}
    for name in COMPONENTS:
        variance, innovation = table[f"{name}_s"], table[f"{name}_innovation"]
        offered = (variance > 0.0) & np.isfinite(innovation)
        squares[name] = innovation[offered] ** 2 / variance[offered]
    return squares
