"""What the sensors of a configured testbed send while it is driven."""

from __future__ import annotations

from collections.abc import Iterable
from math import sqrt

import numpy as np

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


def readings(
    settings: Settings, motion: Motion, response: Response, rng: np.random.Generator
) -> list[Reading]:
    """What the channels send, in order of receipt: calibration undone, latency, noise, counts and
    ADC steps.
    """
    values = {
        "wheel_encoder": np.asarray(motion.wheel_angle),
        "carriage_encoder": np.asarray(motion.carriage_position) / settings.pulley_radius,
        "sinkage_pot": np.asarray(response.sensed.sinkage),
        "motor_shunt": np.asarray(response.sensed.current),
        "motor_temperature": np.full(np.shape(motion.time), AMBIENT),
    }

    sent = []
    for name, channel in settings.channels.items():
        some = slice(None, None, SPARSE if name == "motor_temperature" else 1)
        sent.append(_channel(channel, np.asarray(motion.time)[some], values[name][some], rng))
    if settings.wrench is not None:
        sent.append(_wrench(settings.wrench, np.asarray(motion.time), response, rng))

    return sorted(
        (reading for channel in sent for reading in channel), key=lambda r: (r.received, r.channel)
    )


def _channel(
    channel: Channel, time: Array, physical: Array, rng: np.random.Generator
) -> Iterable[Reading]:
    counted = channel.name in ENCODERS
    noise = sqrt(max(channel.noise**2 - ROUNDING, 0.0)) if counted else channel.noise
    raw = _raw(channel.calibration, physical) + noise * rng.standard_normal(time.size)
    stamps = _stamps(time, channel.latency)

    if counted:
        counts = np.rint(raw).astype(np.int64).tolist()
        return [
            Reading(s, channel.name, count, s + TRANSPORT)
            for s, count in zip(stamps, counts, strict=True)
        ]

    step = (channel.high - channel.low) / ADC_STEPS
    volts = np.clip(
        channel.low + step * np.rint((raw - channel.low) / step), channel.low, channel.high
    ).tolist()
    return [
        Reading(s, channel.name, value, s + TRANSPORT)
        for s, value in zip(stamps, volts, strict=True)
    ]


def _wrench(
    wrench: Wrench, time: Array, response: Response, rng: np.random.Generator
) -> Iterable[Reading]:
    sensed = response.sensed
    axes = dict.fromkeys(WRENCH_FIELDS, np.zeros(time.size))
    axes["fx"] = _raw(wrench.drawbar_pull, np.asarray(sensed.drawbar_pull))
    axes["fz"] = _raw(wrench.load, np.asarray(sensed.load))
    axes["ty"] = _raw(wrench.torque, np.asarray(sensed.torque))

    noise = np.repeat([wrench.force_noise, wrench.torque_noise], 3)
    noisy = (
        axes[name] + sigma * rng.standard_normal(time.size)
        for name, sigma in zip(WRENCH_FIELDS, noise, strict=True)
    )

    six = np.stack(list(noisy), axis=1).tolist()
    stamps = _stamps(time, wrench.latency)
    return [
        Reading(s, "wrench", tuple(row), s + TRANSPORT) for s, row in zip(stamps, six, strict=True)
    ]


def _raw(calibration: Calibration, physical: Array) -> Array:
    raw: Array = (physical - calibration.offset.value) / calibration.scale.value
    return raw


def _stamps(time: Array, latency: float) -> list[int]:
    stamps: list[int] = (START + np.rint((time + latency) * NS).astype(np.int64)).tolist()
    return stamps
