"""The on-line filter over the same recordings, before and after: is what it says of itself true?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

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
from gritd.tools.diagnose.explain.result import Diagnosis, Fit

Reads = Sequence[Callable[[], Recording]]  # give a recording each

NO_FILTER = "A drive without soil: no on-line filter runs over it."
NO_UPDATE = (
    "The on-line filter was offered no update: torque, load or motion are missing, or the wheel"
    " never settled."
)
NOTHING_NEW = "Nothing was accepted, so the on-line filter stays as it is."


def with_innovations(
    diagnosis: Diagnosis, configuration: config.Configuration, reads: Reads, jobs: int = 1
) -> Diagnosis:
    """The result with the filter's normalised innovations by the given configuration and by the
    improved one; where there are none, `innovation_note` says why. jobs: processes.
    """
    try:
        fit = _compared(diagnosis, configuration, reads, jobs)
    except (RecordingError, config.ConfigError) as error:
        note = f"The on-line filter could not run: {error}."
        fit = replace(diagnosis.fit, innovation_note=note)
    return replace(diagnosis, fit=fit)


def _compared(
    diagnosis: Diagnosis, configuration: config.Configuration, reads: Reads, jobs: int
) -> Fit:
    fit = diagnosis.fit
    if diagnosis.soil is None:
        return replace(fit, innovation_note=NO_FILTER)

    before, note = innovations(configuration.settings, reads, jobs), NOTHING_NEW
    after = before
    if before and (diagnosis.accepted or diagnosis.law is not None):
        improved = config.loads(applied(configuration, diagnosis), "improved configuration")
        after, note = innovations(improved.settings, reads, jobs), ""

    if not after:
        return replace(fit, innovation_note=NO_UPDATE)
    return replace(fit, innovation_before=before, innovation_after=after, innovation_note=note)


def innovations(settings: Settings, reads: Reads, jobs: int = 1) -> dict[str, float]:
    """Root mean square of innovation over its stated standard deviation, per component; 1 where
    they are true. jobs: processes.

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
