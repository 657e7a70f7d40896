"""The sensor chain: when a sample is taken, what the converter makes of it, and which samples never
arrive.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.messages.readings import Reading
from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt

NS = 1_000_000_000
TRANSPORT = (2e-4, 2e-3)  # [s] from sampling to receipt


@dataclass(frozen=True)
class SensorNoise:
    """Of one reading, in raw units: white, and a coloured part of its own correlation time."""

    white: float
    colour: float
    time: float  # correlation time of the coloured part [s]
    pink: bool = False  # three correlation times, a decade apart, instead of one

    def drawn(self, rng: np.random.Generator, count: int, step: float) -> Array:
        """Noise (count,) of readings that are `step` [s] apart."""
        times = (0.1 * self.time, self.time, 10.0 * self.time) if self.pink else (self.time,)
        slow = sum(
            (_autoregressive(rng, count, step / time) for time in times), start=np.zeros(count)
        )
        return np.asarray(
            self.white * rng.standard_normal(count) + self.colour / np.sqrt(len(times)) * slow
        )


def _autoregressive(rng: np.random.Generator, count: int, steps: float) -> Array:
    """Unit variance, correlation e^(−steps) from one sample to the next."""
    keep = float(np.exp(-steps))
    kicks = np.sqrt(1.0 - keep * keep) * rng.standard_normal(count)
    state, values = float(rng.standard_normal()), []
    for kick in kicks.tolist():
        state = keep * state + kick
        values.append(state)
    return np.array(values)


@dataclass(frozen=True)
class Converter:
    """One channel from physics to number: raw = (physical − offset)/scale, as it truly is."""

    channel: str
    scale: float
    offset: float
    noise: SensorNoise
    quantum: float  # raw unit of the last bit
    low: float
    high: float
    latency: float  # [s] the stamp is later than the sample
    rate: float  # [Hz]

    def raw(self, time: Array, at: Array, physical: Array, rng: np.random.Generator) -> Array:
        """Raw values (m,) sampled `at` (m,) from a signal over `time` (n,)."""
        true = (np.interp(at, time, physical) - self.offset) / self.scale
        noisy = true + self.noise.drawn(rng, at.size, 1.0 / self.rate)
        return np.clip(self.quantum * np.rint(noisy / self.quantum), self.low, self.high)


@dataclass(frozen=True)
class SensorChain:
    """All channels of a rig, its clock's jitter and its losses."""

    converters: tuple[Converter, ...]  # of the simple channels
    wrench: tuple[Converter, Converter, Converter] | None  # drawbar pull, load, torque
    jitter: float  # [s] standard deviation of a sampling instant
    lost: float  # share of samples that never arrive


def readings(
    chain: SensorChain, felt: Felt, pulley: float, begins: int, rng: np.random.Generator
) -> list[Reading]:
    """What the devices send in one run, by time of receipt; `begins` is the run's start [ns since
    the epoch].
    """
    time = felt.scene.motion.time - felt.scene.motion.time[0]
    signals = {
        "wheel_encoder": felt.scene.motion.turn,
        "carriage_encoder": (felt.carriage - felt.carriage[0]) / pulley,
        "sinkage_pot": felt.sinkage,
        "motor_shunt": felt.current,
        "motor_temperature": 21.0 + 0.02 * time,
    }

    sent: list[Reading] = []
    for converter in chain.converters:
        sent += _channel(chain, converter, time, signals[converter.channel], begins, rng)
    if chain.wrench is not None:
        sent += _wrench(chain, chain.wrench, time, felt, begins, rng)

    return sorted(sent, key=lambda reading: (reading.received, reading.channel))


def _instants(chain: SensorChain, rate: float, time: Array, rng: np.random.Generator) -> Array:
    """Sampling instants [s] of a channel: a rate, a random phase, jitter, and gaps."""
    instants = rng.uniform(0.0, 1.0 / rate) + np.arange(int(time[-1] * rate)) / rate
    instants = instants + chain.jitter * rng.standard_normal(instants.size)
    return np.sort(instants[rng.random(instants.size) >= chain.lost])


def _stamped(
    converter: Converter, at: Array, begins: int, rng: np.random.Generator
) -> Iterator[tuple[int, int]]:
    stamps = begins + np.rint((at + converter.latency) * NS).astype(np.int64)
    received = stamps + np.rint(rng.uniform(*TRANSPORT, at.size) * NS).astype(np.int64)
    return zip(stamps.tolist(), received.tolist(), strict=True)


def _channel(
    chain: SensorChain,
    converter: Converter,
    time: Array,
    signal: Array,
    begins: int,
    rng: np.random.Generator,
) -> list[Reading]:
    at = _instants(chain, converter.rate, time, rng)
    raw: NDArray[np.int64] | Array = converter.raw(time, at, signal, rng)
    if converter.channel.endswith("_encoder"):
        raw = raw.astype(np.int64)

    moments = _stamped(converter, at, begins, rng)
    return [
        Reading(s, converter.channel, v, r) for (s, r), v in zip(moments, raw.tolist(), strict=True)
    ]


def _wrench(
    chain: SensorChain,
    axes: tuple[Converter, Converter, Converter],
    time: Array,
    felt: Felt,
    begins: int,
    rng: np.random.Generator,
) -> list[Reading]:
    at = _instants(chain, axes[0].rate, time, rng)
    fx, fz, ty = (
        axis.raw(time, at, signal, rng)
        for axis, signal in zip(axes, (felt.pull, felt.load, felt.torque), strict=True)
    )

    fy, tx, tz = (axes[k].noise.drawn(rng, at.size, 1.0 / axes[k].rate) for k in (0, 2, 2))
    fy = fy + np.interp(at, time, felt.side)

    six = np.stack((fx, fy, fz, tx, ty, tz), axis=1).tolist()
    moments = _stamped(axes[0], at, begins, rng)
    return [Reading(s, "wrench", tuple(row), r) for (s, r), row in zip(moments, six, strict=True)]
