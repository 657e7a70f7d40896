"""Angles, positions and speeds as the counts of an encoder."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.settings import Settings, Uncertain
from gritd.tools.importers.recording import counts
from gritd.tools.importers.series.calibrated import CalibratedChannel
from gritd.tools.importers.series.mapping import Mapped
from gritd.tools.importers.series.noise import spacing
from gritd.tools.importers.series.runs import SeriesRun

CHANNELS = {
    "wheel_encoder": ("wheel_count", "wheel_angle", "wheel_speed", "rim_speed"),
    "carriage_encoder": ("carriage_count", "carriage_position", "carriage_speed"),
}
COUNTED = ("wheel_count", "carriage_count")  # counts already
SPEEDS = ("wheel_speed", "rim_speed", "carriage_speed")
LEAST_COUNT = 1e-11  # [rad, m]: programs write sixteen digits of what no encoder resolves
FINEST = 2.0**-40  # of its range: a finer count would not fit into 64 bits with room to spare
LEAST = 0.3  # [count] standard deviation of what only rounds, and a little jitter


def quantum(runs: Sequence[SeriesRun], name: str, column: Mapped) -> float:
    """What one count stands for, in the column's unit, of a speed times s: the least step that the
    files can tell.
    """
    if column.channel in COUNTED:
        return 1.0

    steps = []
    for run in runs:
        values = run.table.column(name)
        step = values.resolution or spacing(values.numbers)
        time = run.interval_of(name) if column.channel in SPEEDS else 1.0
        span = float(np.nanmax(np.abs(values.numbers), initial=0.0)) * time
        least = LEAST_COUNT / (column.per_unit * abs(column.factor.value))
        steps.append(max(step * time, span * FINEST, least))

    return min(steps)


def calibrated(
    column: Mapped, quantum: float, noise: float, interval: float, settings: Settings
) -> CalibratedChannel:
    """Angle per count, and noise in counts. `noise` is of one number of the column.

    That of a speed becomes the noise of an angle whose slope over the filter's window of N readings
    is as uncertain as the mean of their speeds: σ_v Δt N / √12.
    """
    radius = _radius(column.channel, settings)
    scale = quantum * column.per_unit / radius
    if column.channel in SPEEDS:
        window = max(1.0 / (settings.rates.update * interval), 1.0)
        noise *= interval * window / 12.0**0.5

    return CalibratedChannel(
        Uncertain(scale * column.factor.value, scale * column.factor.sigma),
        Uncertain(column.offset.value / radius, column.offset.sigma / radius),
        max(noise / quantum, LEAST),
    )


def _radius(channel: str, settings: Settings) -> float:
    """What metres of a channel are divided by to be an angle of its encoder; 1 of an angle."""
    if channel.startswith("carriage"):
        return settings.pulley_radius
    return settings.wheel.radius if channel == "rim_speed" else 1.0


def counted(
    seconds: NDArray[np.float64], numbers: NDArray[np.float64], column: Mapped, quantum: float
) -> NDArray[np.int64]:
    """Counts (n,) of numbers (n,) without gaps. A speed is summed up, over a gap with the mean of
    its ends; what wraps is laid end to end.
    """
    numbers = end_to_end(numbers, column)
    if column.channel in SPEEDS:
        return counts(seconds, numbers, quantum)
    return np.round(numbers / quantum).astype(np.int64)


def end_to_end(numbers: NDArray[np.float64], column: Mapped) -> NDArray[np.float64]:
    """The numbers (n,) of a column that wraps as if it did not; NaN in a gap."""
    if column.wraps is None:
        return numbers
    known, laid = np.isfinite(numbers), numbers.copy()
    laid[known] = np.unwrap(numbers[known], period=column.wraps / column.per_unit)
    return laid
