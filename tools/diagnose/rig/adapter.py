"""The rig that a set of recordings was made on."""

from __future__ import annotations

from collections.abc import Sequence

from gritd.estimator.config.settings import Settings
from gritd.estimator.recording.salvage import Recording
from gritd.tools.diagnose.rig.drive import RATE as DRIVE_RATE
from gritd.tools.diagnose.rig.drive import DriveRig
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.signals import drive_series, is_drive, signals
from gritd.tools.diagnose.rig.wheel import WheelRig

# all runs together up to so long [s]: grid [Hz]
RATES = ((400.0, 10.0), (1200.0, 5.0), (float("inf"), 2.5))
FIRST = 1.0  # [Hz] grid on which the length of the recordings is found


def rig_of(recordings: Sequence[Recording], settings: Settings) -> tuple[Rig, float]:
    """The adapter that fits the recordings, and its grid [Hz]. Raises CommandError."""
    if is_drive(recordings):
        series = [drive_series(r, settings) for r in recordings]
        names = [r.run.name or r.path.stem for r in recordings]
        return DriveRig(series, names, settings), DRIVE_RATE

    coarse = [signals(r, settings, FIRST) for r in recordings]
    length = sum(float(s.time[-1]) for s in coarse)
    rate = next(hertz for limit, hertz in RATES if length <= limit)
    in_time = sorted(zip(recordings, coarse, strict=True), key=lambda pair: pair[1].start)
    return WheelRig([signals(r, settings, rate) for r, _ in in_time], settings), rate
