"""Readings of a wheel that ripples, made for tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gritd.tools.diagnose.orders.stretches import TURN, Samples

RATE = 250.0  # [Hz]
SPEEDS = (0.15, 0.3, 0.45)  # [rad/s]


def readings(
    rng: np.random.Generator,
    ripple: tuple[float, float, float] = (0.0, 0.0, 0.0),
    hum: tuple[float, float] = (0.0, 0.0),
    drift: float = 0.0,
    seconds: float = 28.0,
) -> Samples:
    """One channel of one run in unit white noise, three speeds.

    ripple: cosine, sine, order; hum: size and frequency [Hz]; drift: size of slow changes.
    """
    time = np.arange(0.0, seconds, 1.0 / RATE)
    stretch = np.minimum((3.0 * time / seconds).astype(np.int64), 2)
    angle = np.cumsum(rng.permutation(SPEEDS)[stretch]) / RATE + rng.uniform(0.0, TURN)

    cos, sin, order = ripple
    size, frequency = hum
    slow = np.exp(-time / (0.3 * seconds)) + np.sin(7.0 * stretch)
    values = (
        rng.standard_normal(time.size)
        + cos * np.cos(order * angle)
        + sin * np.sin(order * angle)
        + size * np.cos(TURN * frequency * time)
        + drift * slow
    )
    return Samples(time, angle / TURN, values, stretch)


def red(samples: Samples, rng: np.random.Generator, size: float) -> Samples:
    """With noise whose memory is a second added."""
    kept = np.exp(-1.0 / RATE)
    slow, now = np.empty(samples.values.size), 0.0
    for number, push in enumerate(rng.standard_normal(slow.size)):
        now = kept * now + np.sqrt(1.0 - kept**2) * push
        slow[number] = size * now
    return samples.with_values(samples.values + slow)


def campaign(each: Sequence[Samples], channel: str = "torque") -> list[dict[str, Samples]]:
    """Runs of one channel."""
    return [{channel: samples} for samples in each]
