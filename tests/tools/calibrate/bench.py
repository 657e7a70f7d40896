"""Simulated procedures: a testbed whose true calibration is known, and what it would record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.messages.run_info import RunInfo
from gritd.tools.commands import init
from gritd.tools.importers.recording import ChannelReadings, write

Array = NDArray[np.float64]
RATE = 100.0  # [Hz]
START = 1_700_000_000_000_000_000
SETTINGS = config.load(packaged()).settings


def rig(folder: Path) -> Path:
    init.main([str(folder)])
    return folder / "testbed.yaml"


def record(path: Path, channels: Mapping[str, tuple[Array, Array]]) -> Path:
    """Channels as seconds and raw values."""
    streams = [
        ChannelReadings(
            name,
            START + np.round(seconds * 1e9).astype(np.int64),
            np.round(raw).astype(np.int64) if name.endswith("encoder") else raw,
        )
        for name, (seconds, raw) in channels.items()
    ]
    return write(path, streams, config.load(packaged()), RunInfo())


def staircase(values: Sequence[float], seconds: float = 4.0) -> tuple[Array, Array]:
    """Seconds, and a signal that stands at each value and moves to the next within half a
    second.
    """
    time = np.arange(0.0, seconds * len(values), 1.0 / RATE)
    knots, levels = [], []
    for number, value in enumerate(values):
        knots += [number * seconds + 0.25, (number + 1) * seconds - 0.25]
        levels += [value, value]
    return time, np.interp(time, knots, levels)


def noisy(values: Array, sigma: float, seed: int) -> Array:
    return values + sigma * np.random.default_rng(seed).standard_normal(values.shape)
