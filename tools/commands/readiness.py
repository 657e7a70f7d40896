"""Why the filter never began on a recording: the required channels that have no value in any
window.
"""

from __future__ import annotations

from math import isnan

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.messages.readings import CHANNELS, ENCODERS, NS
from gritd.estimator.offline.batch import window_ends
from gritd.estimator.offline.snapshots import snapshots
from gritd.estimator.offline.streams import recorded_streams
from gritd.estimator.recording.salvage import Recording

# required channel -> what a snapshot has of it
VALUES = {
    "wheel_encoder": "wheel_speed",
    "carriage_encoder": "carriage_speed",
    "sinkage_pot": "sinkage",
    "motor_shunt": "current",
}


def never_ready(settings: Settings, recording: Recording) -> str:
    """One line. Raises RecordingError."""
    replayed = recorded_streams(recording, settings.rates.tick)
    ends = window_ends(replayed.ticks, round(NS / settings.rates.update))
    seen = list(snapshots(settings, replayed, ends))

    missing = [
        name for name, value in VALUES.items() if all(isnan(getattr(s, value).value) for s in seen)
    ]

    if not missing:
        return (
            "never ready: every required channel has readings, but never all of them in one window"
        )
    return "never ready: " + "; ".join(_reason(settings, recording, name) for name in missing)


def _reason(settings: Settings, recording: Recording, name: str) -> str:
    """What is wrong with the readings of a channel."""
    rows, channel = recording.arrays(f"/raw/{name}"), settings.channels[name]
    if not rows.size:
        return f"{name} has no readings"

    window = f"{1e3 / settings.rates.update:g} ms"
    if name in ENCODERS:
        return f"{name} has {rows.size} readings, never three over half a window of {window}"

    raw = rows[CHANNELS[name][0]]
    invalid = int(np.count_nonzero(~((channel.low <= raw) & (raw <= channel.high))))
    if not invalid:
        return f"{name} has {rows.size} readings, too few for a window of {window}"
    return (
        f"{invalid} of {rows.size} readings of {name} are invalid, "
        f"outside {channel.low:g} … {channel.high:g} V"
    )
