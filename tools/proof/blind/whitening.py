"""Channels of a campaign as signals, and the noise that they are measured by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_triangular, toeplitz

from gritd.tools.proof.blind.plant.quadrature import Array
from gritd.tools.proof.blind.plant.scene import Felt
from gritd.tools.proof.blind.plant.sensors import Converter, SensorChain

RATE = 5.0  # [Hz]
FLOOR, FLOOR_TIME = 0.003, 1.0  # of the channel's root mean square; [s]

Signals = list[dict[str, Array]]  # a dict of channels for every run, SI
INSTRUMENT = {
    "sinkage": "sinkage_pot",
    "current": "motor_shunt",
    "pull": "drawbar_pull",
    "load": "load",
    "torque": "torque",
}


def channels(felt: Felt, wrench: bool) -> dict[str, Array]:
    """Every analogue channel (n,) that is recorded; a lifted wheel's sinkage says nothing."""
    down = felt.scene.motion.weight > 1.0
    read = {"sinkage": felt.sinkage * down, "current": felt.current}
    return read | {"pull": felt.pull, "load": felt.load, "torque": felt.torque} if wrench else read


def whitened(signals: Signals, roots: Signals) -> Array:
    """All channels and runs over their noise, (m,); `roots` (n, n) as of `noise_roots`."""
    return np.concatenate(
        [
            solve_triangular(root[name], values, lower=True)
            for run, root in zip(signals, roots, strict=True)
            for name, values in run.items()
        ]
    )


def less(one: Signals, other: Signals) -> Signals:
    return [{name: a[name] - b[name] for name in a} for a, b in zip(one, other, strict=True)]


def scaled(signals: Signals, factor: float) -> Signals:
    return [{name: factor * values for name, values in run.items()} for run in signals]


def one_by_one(signals: Signals) -> list[Signals]:
    """The change in one run alone, for every run."""
    return [
        _scaled_by(signals, [float(n == place) for n in range(len(signals))])
        for place in range(len(signals))
    ]


def _scaled_by(signals: Signals, factors: Sequence[float]) -> Signals:
    return [scaled([run], factor)[0] for run, factor in zip(signals, factors, strict=True)]


def held_out(sizes: Sequence[int]) -> list[tuple[int, Array]]:
    """What is held out in turn: a run and a mask (n,) of its samples. Whole runs, or thirds of a
    single one.
    """
    if len(sizes) > 1:
        return [(run, np.ones(size, dtype=bool)) for run, size in enumerate(sizes)]
    third = np.arange(sizes[0]) * 3 // sizes[0]
    return [(0, third == part) for part in range(3)]


def noise_roots(chain: SensorChain, felt: Felt) -> dict[str, Array]:
    """Cholesky factor of each channel's noise covariance at RATE, in SI (n, n)."""
    converters = {c.channel: c for c in (*chain.converters, *(chain.wrench or ()))}
    read = channels(felt, chain.wrench is not None)
    sizes = {name: float(np.sqrt(np.mean(values**2))) for name, values in read.items()}
    return {
        name: _root(converters[INSTRUMENT[name]], values.size, sizes[name])
        for name, values in read.items()
    }


def _root(converter: Converter, count: int, size: float) -> Array:
    noise, apart = converter.noise, np.arange(count) / RATE
    white = np.zeros(count)
    white[0] = (noise.white**2 + converter.quantum**2 / 12.0) * RATE / converter.rate
    times = (0.1 * noise.time, noise.time, 10.0 * noise.time) if noise.pink else (noise.time,)
    slow = sum((_mean_square(t) * np.exp(-apart / t) for t in times), start=np.zeros(count))
    own = abs(converter.scale) ** 2 * (white + noise.colour**2 / len(times) * slow)
    covariance = toeplitz(own + (FLOOR * size) ** 2 * np.exp(-apart / FLOOR_TIME))
    root: Array = np.linalg.cholesky(covariance + 1e-12 * covariance[0, 0] * np.eye(count))
    return root


def _mean_square(time: float) -> float:
    """Variance of the mean over one interval of unit noise with this correlation time [s]."""
    x = 1.0 / (RATE * time)
    return float(2.0 * (x - 1.0 + np.exp(-x)) / x**2)
