"""The real recordings beside the repository; they belong to others, and a test without them is
skipped.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gritd.estimator.config import configuration as config
from gritd.estimator.config.settings import Settings
from gritd.estimator.recording import salvage

REAL = Path(__file__).parents[2] / "shared" / "real"

Array = NDArray[np.float64]


def needs(rig: str) -> pytest.MarkDecorator:
    """Skip where a rig's files are absent; docs/importing.md says where public ones are from."""
    folder = REAL / rig
    return pytest.mark.skipif(
        not folder.is_dir(), reason=f"no real recordings in {folder}; see docs/importing.md"
    )


class Physical:
    """An imported recording through its own calibration: seconds since its first reading, and SI
    values.
    """

    def __init__(self, path: Path) -> None:
        self.recording = salvage.read(path)
        assert self.recording.complete
        assert self.recording.config_yaml is not None
        self.settings: Settings = config.loads(self.recording.config_yaml, path.name).settings
        channels = ("wheel_encoder", "carriage_encoder", "sinkage_pot", "motor_shunt", "wrench")
        self._rows = {name: self.recording.arrays(f"/raw/{name}") for name in channels}
        self.start = min(int(rows["stamp"][0]) for rows in self._rows.values() if len(rows))

    def time(self, channel: str) -> Array:
        """Seconds since the first reading of the recording, shape (n,)."""
        return np.asarray((self._rows[channel]["stamp"] - self.start) / 1e9)

    def value(self, channel: str) -> Array:
        """Calibrated values of a channel with one value, shape (n,)."""
        calibration = self.settings.channels[channel].calibration
        field = "count" if channel.endswith("encoder") else "volts"
        return np.asarray(
            self._rows[channel][field] * calibration.scale.value + calibration.offset.value
        )

    def force(self, axis: str) -> Array:
        """One axis of the wrench as read, shape (n,)."""
        return np.asarray(self._rows["wrench"][axis])

    def speed(self, channel: str, begin: float, end: float) -> float:
        """Mean rate of an encoder between two times [1/s]."""
        time, value = self.time(channel), self.value(channel)
        inside = (time > begin) & (time < end)
        return float(np.polyfit(time[inside], value[inside], 1)[0])
