"""Amplitudes of one line in the readings of a channel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.orders.stretches import Samples
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SQUARE


@dataclass(frozen=True)
class Amplitude:
    """a cos 2πox + b sin 2πox, in the channel's unit, and the standard deviation of a and of b."""

    cos: float
    sin: float
    sigma: float

    @property
    def size(self) -> float:
        return float(np.hypot(self.cos, self.sin))


def pair(place: Array, at: Array | float) -> Array:
    """Cosine and sine (n, …, 2) of `at` (…) cycles a unit, at places (n,)."""
    phase = 2.0 * np.pi * np.multiply.outer(place, at)
    return np.stack((np.cos(phase), np.sin(phase)), axis=-1)


def amplitude_of(part: Samples, axis: str, at: float, level: float) -> Amplitude:
    """By least squares beside the stretches' trends, in values without a trend. level: power of the
    noise about the line; of white noise its variance.
    """
    columns = part.detrended(pair(part.of(axis), at))
    products = columns.T @ columns
    cos, sin = np.linalg.lstsq(products, columns.T @ part.values, rcond=None)[0].tolist()
    sigma = np.sqrt(level * 2.0 / max(float(np.trace(products)), SQUARE))
    return Amplitude(cos, sin, float(sigma))


def wave_of(part: Samples, axis: str, at: float, whole: bool = False) -> Array:
    """The line's part of values (n,) without a trend: each stretch its own amplitude where it holds
    some cycles; whole: one amplitude for all.
    """
    columns = part.detrended(pair(part.of(axis), at))
    out = np.zeros(part.values.size)
    for own in [slice(None)] if whole else _groups(part, axis, at):
        taken = columns[own]
        out[own] = taken @ np.linalg.lstsq(taken, part.values[own], rcond=None)[0]
    return out


def _groups(part: Samples, axis: str, at: float) -> list[slice]:
    """Stretches, or all of them together where one holds too few cycles."""
    place = part.of(axis)
    held = [at * float(np.ptp(place[own])) for own in part.slices]
    if min(held) < TUNING.orders.cycles:
        return [slice(None)]
    return list(part.slices)
