"""Why the filter never began on a recording: the required channels that have no value in any
window.
"""

from __future__ import annotations

from math import isnan

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.messages.readings import CHANNELS, ENCODERS, NS
from gritd.estimator.offline.run_window import windows
from gritd.estimator.offline.snapshots import snapshots
from gritd.estimator.offline.streams import recorded_streams
from gritd.estimator.recording.salvage import Recording
from gritd.estimator.wheel.wheel_state import required

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
    part = windows(settings, replayed)[-1]
    seen = list(snapshots(settings, replayed, part.ends, part.length))

    missing = [
        name
        for name, value in VALUES.items()
        if name in required(settings) and all(isnan(getattr(s, value).value) for s in seen)
    ]

    if not missing:
        return (
            "never ready: every required channel has readings, but never all of them in one window"
        )
    return "never ready: " + "; ".join(
        _reason(settings, recording, name, part.length / NS) for name in missing
    )


def _reason(settings: Settings, recording: Recording, name: str, length: float) -> str:
    """What is wrong with the readings of a channel."""
    rows, channel = recording.arrays(f"/raw/{name}"), settings.channels[name]
    if not rows.size:
        return f"{name} has no readings"

    window = f"{1e3 * length:g} ms"
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
