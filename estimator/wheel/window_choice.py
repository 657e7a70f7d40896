"""The length of a window, where the configuration leaves it open: as short as the noise of slip
allows.

A speed is the slope of an encoder over the window, so the noise of slip falls with the window to
the power of 3/2. What the encoders read while the wheel drives says how noisy they are, and how
often they come.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import hypot, inf, sqrt
from typing import NamedTuple

from gritd.estimator.config.settings import Settings
from gritd.estimator.messages.readings import ENCODERS, NS
from gritd.estimator.wheel.sync import Measured, Snapshot
from gritd.estimator.wheel.windows import Sample

LENGTHS = (0.1, 0.2, 0.4, 0.8, 1.6, 3.2)  # [s]
# σ of slip in a window that is short enough; 1 % of slip is about 1 % of the torque, as much as a
# usual load cell's noise
WANTED = 0.01
LEAST = 5  # readings of each encoder in a window
STEADY = 0.2  # relative change of a speed from one window to the next


class Cadence(NamedTuple):
    """How an encoder reads while it moves."""

    interval: float  # [s] between two readings
    scatter: float  # [raw] σ of one about its neighbours


def driving(now: Snapshot, before: Snapshot | None) -> bool:
    """Whether wheel and carriage move as they did in the window before."""
    if before is None or not (now.ready and before.ready):
        return False
    speeds = zip(
        (now.wheel_speed, now.carriage_speed),
        (before.wheel_speed, before.carriage_speed),
        strict=True,
    )
    return all([_moves(a) and _alike(a, b) for a, b in speeds])


def window_of(settings: Settings, now: Snapshot, samples: Mapping[str, Sequence[Sample]]) -> int:
    """The length [ns] of the windows of a run, a whole number of ticks.

    now: a window in which wheel and carriage drive; samples: what each encoder read in it.
    """
    cadences = {name: _cadence(samples[name], settings.channels[name].noise) for name in ENCODERS}
    return chosen(settings, (now.wheel_speed.value, now.carriage_speed.value), cadences)


def chosen(settings: Settings, speeds: tuple[float, float], cadences: Mapping[str, Cadence]) -> int:
    """The length [ns] at speeds of wheel [rad/s] and carriage [m/s]."""
    tick = round(NS / settings.rates.tick)
    lengths = [max(2, round(length * NS / tick)) * tick for length in LENGTHS]

    for length in lengths[:-1]:
        if slip_sigma(settings, speeds, cadences, length / NS) <= WANTED:
            return length
    return lengths[-1]


def slip_sigma(
    settings: Settings,
    speeds: tuple[float, float],
    cadences: Mapping[str, Cadence],
    seconds: float,
) -> float:
    """σ of slip in a window of so many seconds at speeds of wheel [rad/s] and carriage [m/s];
    infinite where too few readings come.
    """
    relative = []
    wheel_speed, carriage_speed = speeds
    speeds = (wheel_speed, carriage_speed / settings.pulley_radius)
    for name, speed in zip(ENCODERS, speeds, strict=True):
        interval, scatter = cadences[name]
        count = seconds / interval
        if count < LEAST:
            return inf
        slope = scatter * settings.channels[name].calibration.scale.value / seconds
        relative.append(slope * sqrt(12.0 / count) / speed)

    wheel, carriage = relative
    # i = 1 − v/(rω): both errors come in as shares of v/(rω), which is one at most when driving
    return hypot(wheel, carriage)


def _cadence(samples: Sequence[Sample], noise: float) -> Cadence:
    """From the readings of a window; the noise is the stated one [raw] at least."""
    gaps = len(samples) - 1
    squares = 0.0
    for a, b, c in zip(samples, samples[1:], samples[2:], strict=False):
        share = (b.stamp - a.stamp) / (c.stamp - a.stamp)
        off = b.value - a.value - share * (c.value - a.value)
        squares += off * off / (1.0 + share * share + (1.0 - share) ** 2)

    shown = sqrt(squares / max(gaps - 1, 1))
    return Cadence((samples[-1].stamp - samples[0].stamp) / gaps / NS, max(shown, noise))


def _moves(speed: Measured) -> bool:
    return abs(speed.value) > 4.0 * speed.sigma


def _alike(now: Measured, before: Measured) -> bool:
    return abs(now.value - before.value) <= STEADY * abs(now.value)
