"""A recorded run as what is checked for what cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.settings import Settings, settings_of_run
from gritd.estimator.messages.readings import CHANNELS
from gritd.estimator.offline.playback import without_absent
from gritd.estimator.offline.streams import RAW
from gritd.estimator.plausibility.driven import DrivenRun, Raw, driven
from gritd.estimator.recording.recording import Recording


def driven_recording(recording: Recording, settings: Settings) -> tuple[DrivenRun, Settings]:
    """The run, and the settings that hold for it. Raises RecordingError."""
    settings = settings_of_run(without_absent(settings, recording), recording.run)
    tables = recording.tables(RAW)
    raw = {
        channel: _raw(tables[f"/raw/{channel}"], names)
        for channel, names in CHANNELS.items()
        if tables[f"/raw/{channel}"].size
    }
    made = driven(recording.path.name, raw, settings, recording.run.nominal_load)
    if recording.run.steady_states:  # each with a silence before the next
        made = replace(made, clock=replace(made.clock, leap=0.0))
    return made, settings


def _raw(rows: NDArray[np.void], names: tuple[str, ...]) -> Raw:
    """Readings in the order of their stamps, each stamp once."""
    _, first = np.unique(rows["stamp"], return_index=True)
    columns = [rows[name][first] for name in names]
    values = columns[0] if len(columns) == 1 else np.stack(columns, axis=1)
    return Raw(rows["stamp"][first], values)
