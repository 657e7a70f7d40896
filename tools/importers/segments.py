"""Steady-state tables as recordings: every condition a segment of constant speed, a short silence
between segments.

A table gives a mean and a standard deviation. Within a segment the means over a tenth of a second
take the quantiles of a normal distribution, in an order that differs by channel: they have mean and
deviation exactly, and the segment's mean is as uncertain as that of INDEPENDENT values. The
readings about these means are as white noise is, so √10 times as uncertain each (`reading_sigma`).
The order is the same in every segment and recording, so equal states read the same in all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from gritd.estimator.config.settings import Uncertain
from gritd.estimator.limits import limits, raised
from gritd.tools.importers.files import Array, RigFileError
from gritd.tools.importers.recording import NS, ChannelReadings, stamps

START = 946_684_800 * NS  # 2000-01-01, for tables that do not say when
RATE = 100  # [Hz]
DURATION = 6.0  # [s] of a segment
PAUSE = 1.0  # [s] between segments
TENTH = RATE // 10  # readings in a tenth of a second
INDEPENDENT = round(RATE * DURATION) // TENTH  # tenths of a second in a segment


@dataclass(frozen=True)
class Condition:
    """One row of a table, SI, with standard deviations of means over a tenth of a second. A pull, a
    torque, a lateral force that was not measured is None.
    """

    rim_speed: float  # rω [m/s]
    carriage_speed: float  # v [m/s]
    sinkage: Uncertain  # z [m]
    load: Uncertain  # W [N]
    drawbar_pull: Uncertain | None = None  # [N]
    lateral_force: Uncertain | None = None  # [N]
    current: Uncertain | None = None  # [A]


@dataclass(frozen=True)
class Counting:
    """How motion becomes counts, and sinkage volts."""

    rim: float  # [m] of rim travel a count
    carriage: float  # [m] a count
    pot_scale: float  # [m/V]
    pot_offset: float  # [m]


def check_few(path: Path, conditions: int) -> None:
    """Raises RigFileError where a table has more conditions than can become a recording."""
    most = limits().conditions
    if conditions > most:
        raise RigFileError(
            f"{path}: found {conditions} steady states; at most {most:.0f} are taken; "
            f"{raised('conditions')}"
        )


def scatter_of_mean(value: float, sigma: float) -> Uncertain:
    """A tabulated value whose own standard deviation is sigma, as tenths of a second whose mean is
    as uncertain.
    """
    return Uncertain(value, sigma * INDEPENDENT**0.5)


def reading_sigma(sigma: float) -> float:
    """Standard deviation of a reading, from that of the tabulated value: the `noise` of a
    channel.
    """
    return float(sigma * np.sqrt(INDEPENDENT * TENTH))


def streams(conditions: Sequence[Condition], counting: Counting) -> list[ChannelReadings]:
    """The segments one after the other, as the channels of a recording. The encoders speak a pause
    earlier and later than all else, so that the first and the last readings have a speed too.
    """
    seconds = PAUSE + np.arange(round(RATE * DURATION)) / RATE
    spacing = DURATION + PAUSE
    times = np.concatenate(
        [stamps(START, seconds + spacing * number) for number in range(len(conditions))]
    )

    pause = round(PAUSE * NS)
    beats = np.concatenate(([times[0] - pause], times, [times[-1] + pause]))
    rim = _travel([c.rim_speed for c in conditions], counting.rim)
    carriage = _travel([c.carriage_speed for c in conditions], counting.carriage)

    sinkage = _all([c.sinkage for c in conditions], 3)
    sensors = [
        ChannelReadings("wheel_encoder", beats, rim),
        ChannelReadings("carriage_encoder", beats, carriage),
        ChannelReadings("sinkage_pot", times, (sinkage - counting.pot_offset) / counting.pot_scale),
    ]

    if any(c.current is not None for c in conditions):
        sensors.append(
            ChannelReadings("motor_shunt", times, _all([c.current for c in conditions], 4))
        )

    axes = np.zeros((len(times), 6))
    axes[:, 0] = _all([c.drawbar_pull for c in conditions], 0)
    axes[:, 1] = _all([c.lateral_force for c in conditions], 1)
    axes[:, 2] = _all([c.load for c in conditions], 2)

    return [*sensors, ChannelReadings("wrench", times, axes)]


def _travel(speeds: Sequence[float], per_count: float) -> NDArray[np.int64]:
    """Counts at constant speed within each segment, standing still in the silences, before the
    first and after the last.
    """
    seconds = np.arange(1, round(RATE * DURATION) + 1) / RATE
    begins = np.concatenate(([0.0], np.cumsum(speeds)[:-1])) * DURATION
    travel = begins[:, None] + np.asarray(speeds)[:, None] * seconds
    whole = np.concatenate(([0.0], travel.ravel(), travel[-1:, -1]))
    return np.asarray(np.round(whole / per_count), dtype=np.int64)


def _all(values: Sequence[Uncertain | None], channel: int) -> Array:
    """One array of mean ± standard deviation, segment by segment; 0 where nothing was measured.
    channel: its number, which orders the scatter.
    """
    rng = np.random.default_rng(channel)
    means = rng.permutation(_scores(INDEPENDENT))
    within = rng.permuted(np.tile(_scores(TENTH), (INDEPENDENT, 1)), axis=1)
    scatter = (means[:, None] + np.sqrt(TENTH - 1.0) * within).ravel()
    known = [value or Uncertain(0.0) for value in values]
    return np.concatenate([v.value + v.sigma * scatter for v in known])


def _scores(count: int) -> Array:
    """Quantiles (count,) of a normal distribution, of mean 0 and standard deviation 1."""
    scores = norm.ppf((np.arange(count) + 0.5) / count)
    return np.asarray(scores / scores.std())
