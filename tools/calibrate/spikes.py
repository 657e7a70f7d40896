"""Single readings far from their neighbours: a loose contact, a bit that flips. They are left out,
and reported.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from gritd.estimator.offline.windows import NORMAL
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.command import DAMAGED, CommandError

NEIGHBOURS = 7  # readings whose median a reading is compared with; a step passes
FAR = 8.0  # [σ] from it
STEPS = 3.0  # and so many of the smallest differences: an encoder at rest has no noise
TURN = 3.0  # and so many of the usual differences about it: where a movement turns round
MOST = 0.05  # of the readings: more are no single spikes


def spikes(values: Array) -> NDArray[np.bool_]:
    """Which of the readings (n,) are spikes."""
    if values.size < NEIGHBOURS:
        return np.zeros(values.size, bool)
    half = NEIGHBOURS // 2
    padded = np.pad(values, half, mode="reflect")
    off = np.abs(values - np.median(sliding_window_view(padded, NEIGHBOURS), axis=1))

    steps = np.abs(np.diff(values))
    quantum = float(steps[steps > 0.0].min()) if (steps > 0.0).any() else 0.0
    # of second differences: neither a level nor a steady change counts as noise
    noise = NORMAL * float(np.median(np.abs(np.diff(values, 2)))) / np.sqrt(6.0)
    about = sliding_window_view(np.abs(np.diff(padded)), NEIGHBOURS - 1)
    usual = np.partition(about, 2, axis=1)[:, 2]  # up to three spikes among them do not raise it
    far: NDArray[np.bool_] = off > max(FAR * noise, STEPS * quantum) + TURN * usual
    return far


def note(found: NDArray[np.bool_], channel: str, where: str = "") -> str:
    """A line on the spikes that are left out; '' without any. Raises CommandError where they are no
    single ones.
    """
    count, total = int(found.sum()), found.size
    if not count:
        return ""
    if count > MOST * total:
        raise CommandError(
            f"{where}{channel}: found {100 * count / total:.0f} % of {total} readings far from "
            f"their neighbours; expected single ones, {100 * MOST:g} % or fewer: mend the wiring",
            DAMAGED,
        )
    return f"{channel}: {count} of {total} readings are single spikes and left out"
