"""What the sensors of a configured testbed send while it is driven."""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.config.settings import Calibration, Channel, Settings, Wrench
from gritd.estimator.messages.readings import ENCODERS, NS, WRENCH_FIELDS, Reading
from gritd.estimator.model.forward import Response
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array

START = 1_767_225_600_000_000_000  # [ns] 2026-01-01: a recording made twice is the same to the byte
TRANSPORT = 1_000_000  # [ns] from a stamp to its receipt
ADC_STEPS = 1 << 16  # over the channel's valid range
AMBIENT = 21.0  # [°C]
# [count²] variance of rounding to whole counts; the stated noise of an encoder includes it
ROUNDING = 1.0 / 12.0
SPARSE = 250  # samples from one temperature to the next


class Sent(NamedTuple):
    """What one channel sends."""

    stamps: NDArray[np.int64]  # (n,) [ns]
    values: NDArray[Any]  # (n,) raw, or (n, 6) of the wrench


def readings(
    settings: Settings, motion: Motion, response: Response, rng: np.random.Generator
) -> list[Reading]:
    """What the channels send, in order of receipt."""
    channels = sent(settings, motion, response, rng)
    return sorted(
        (reading for name, each in channels.items() for reading in _listed(name, each)),
        key=lambda r: (r.received, r.channel),
    )


def _listed(name: str, sent: Sent) -> Iterator[Reading]:
    rows = sent.values.tolist()
    values = rows if sent.values.ndim == 1 else map(tuple, rows)
    for stamp, value in zip(sent.stamps.tolist(), values, strict=True):
        yield Reading(stamp, name, value, stamp + TRANSPORT)


def sent(
    settings: Settings, motion: Motion, response: Response, rng: np.random.Generator
) -> dict[str, Sent]:
    """What each channel sends: calibration undone, latency, noise, counts and ADC steps."""
    time = np.asarray(motion.time)
    values = {
        "wheel_encoder": np.asarray(motion.wheel_angle),
        "carriage_encoder": np.asarray(motion.carriage_position) / settings.pulley_radius,
        "sinkage_pot": np.asarray(response.sensed.sinkage),
        "motor_shunt": np.asarray(response.sensed.current),
        "motor_temperature": np.full(time.shape, AMBIENT),
    }

    streams = {}
    for name, channel in settings.channels.items():
        some = slice(None, None, SPARSE if name == "motor_temperature" else 1)
        streams[name] = _channel(channel, time[some], values[name][some], rng)
    if settings.wrench is not None:
        streams["wrench"] = _wrench(settings.wrench, time, response, rng)
    return streams


def _channel(channel: Channel, time: Array, physical: Array, rng: np.random.Generator) -> Sent:
    counted = channel.name in ENCODERS
    noise = sqrt(max(channel.noise**2 - ROUNDING, 0.0)) if counted else channel.noise
    raw = _raw(channel.calibration, physical) + noise * rng.standard_normal(time.size)
    stamps = _stamps(time, channel.latency)
    if counted:
        return Sent(stamps, np.rint(raw).astype(np.int64))

    step = (channel.high - channel.low) / ADC_STEPS
    volts = channel.low + step * np.rint((raw - channel.low) / step)
    return Sent(stamps, np.clip(volts, channel.low, channel.high))


def _wrench(wrench: Wrench, time: Array, response: Response, rng: np.random.Generator) -> Sent:
    sensed = response.sensed
    axes = dict.fromkeys(WRENCH_FIELDS, np.zeros(time.size))
    axes["fx"] = _raw(wrench.drawbar_pull, np.asarray(sensed.drawbar_pull))
    axes["fz"] = _raw(wrench.load, np.asarray(sensed.load))
    axes["ty"] = _raw(wrench.torque, np.asarray(sensed.torque))

    noise = np.repeat([wrench.force_noise, wrench.torque_noise], 3)
    noisy = [
        axes[name] + sigma * rng.standard_normal(time.size)
        for name, sigma in zip(WRENCH_FIELDS, noise, strict=True)
    ]
    return Sent(_stamps(time, wrench.latency), np.stack(noisy, axis=1))


def _raw(calibration: Calibration, physical: Array) -> Array:
    raw: Array = (physical - calibration.offset.value) / calibration.scale.value
    return raw


def _stamps(time: Array, latency: float) -> NDArray[np.int64]:
    return START + np.rint((time + latency) * NS).astype(np.int64)
