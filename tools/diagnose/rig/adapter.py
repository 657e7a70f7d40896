"""The rig that a set of recordings was made on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.recording.salvage import Recording
from gritd.tools.cli.command import DAMAGED, USAGE, CommandError
from gritd.tools.diagnose.rig.full_rate import with_lines
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.rig.signals import drive_series, in_runs, is_drive, signals
from gritd.tools.diagnose.rig.wheel import Bed, wheel_rig
from gritd.tools.diagnose.tuning import TUNING


def rig_of(
    recordings: Sequence[Recording],
    settings: Settings,
    reference: Sequence[Recording] = (),
    bed: Bed = "prepared",
) -> tuple[Rig, float]:
    """The adapter that fits the recordings, and its grid [Hz]. Raises CommandError.

    reference: recordings of a campaign in which nothing is new; bed: whether the others drive on
    the same bed or on one prepared anew.
    """
    if not is_drive(recordings):
        return _wheel_rig(recordings, settings, reference, bed)

    if reference:
        raise CommandError(
            "--reference: found a drive without soil; expected a wheel's recordings", USAGE
        )
    return _drive_rig(recordings, settings), TUNING.rig.rate


def _drive_rig(recordings: Sequence[Recording], settings: Settings) -> Rig:
    # loads scipy.signal and scipy.stats too: a second and 60 MB, which nobody pays for a wheel
    from gritd.tools.diagnose.rig.drive import drive_rig

    series = [drive_series(r, settings) for r in recordings]
    names = [r.run.name or r.path.stem for r in recordings]
    return drive_rig(series, names, settings)


def _wheel_rig(
    recordings: Sequence[Recording], settings: Settings, reference: Sequence[Recording], bed: Bed
) -> tuple[Rig, float]:
    coarse = [
        [signals(r, settings, TUNING.rig.rates[-1][1]) for r in each]
        for each in (reference, recordings)
    ]
    length = sum(float(s.time[-1]) for each in coarse for s in each)
    rate = next(hertz for limit, hertz in TUNING.rig.rates if length <= limit)

    in_time = [
        sorted(zip(each, rough, strict=True), key=lambda pair: pair[1].start)
        for each, rough in zip((reference, recordings), coarse, strict=True)
    ]
    ordered = [r for each in in_time for r, _ in each]
    means = [signals(r, settings, rate) for r in ordered]

    beside, lines = with_lines(ordered, means, settings, len(reference))

    known = len(in_runs(beside[: len(reference)]))

    rig = wheel_rig(in_runs(beside), settings, known, bed, lines=lines)
    for new, each in ((False, reference), (True, recordings)):
        _check_drives(rig, new, each)
    return rig, rate


def _check_drives(rig: Rig, new: bool, recordings: Sequence[Recording]) -> None:
    """Raises CommandError where the runs of a campaign are too short for a channel to tell
    anything: values count from some time after the wheel has started. What a campaign did not
    measure at all is no channel of it.
    """
    runs = [run for run, acting in zip(rig.runs, rig.new, strict=True) if acting == new]
    if not runs:
        return

    names = ", ".join(str(recording.path) for recording in recordings)
    measured = [c for c in rig.channels if any(np.isfinite(r.measured[c]).any() for r in runs)]
    counts = {c: sum(int(run.used[c].sum()) for run in runs) for c in measured}

    channel, least = min(counts.items(), key=lambda item: item[1], default=("any channel", 0))
    if not least:
        raise CommandError(
            f"{names}: found no value of {channel} while the wheel drives steadily;"
            " expected a run that goes on for longer after the wheel has started",
            DAMAGED,
        )
