"""What a potentiometer and a shunt amplifier say while known values are set, as recordings.

It stands for two hands, a set of gauge blocks and a current source. The true calibration differs a
little from what `gritd init` writes: that difference is what `gritd calibrate` has to find.
"""

from pathlib import Path

import numpy as np

from gritd.config import packaged
from gritd.estimator.config.configuration import load
from gritd.estimator.messages.run_info import RunInfo
from gritd.tools.importers.recording import ChannelReadings, stamps, write

RATE = 100.0  # [Hz]
STAY, MOVE = 3.5, 0.5  # [s] at a value, and from one to the next
START = 1_795_000_000_000_000_000  # [ns since 1970]
SEED = 16


def staircase(values: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] (n,) and a signal (n,) that stays at each value."""
    begins = np.arange(len(values)) * (STAY + MOVE)
    time = np.arange(0.0, begins[-1] + STAY, 1.0 / RATE)
    knots = np.column_stack([begins, begins + STAY]).ravel()
    return time, np.interp(time, knots, np.repeat(values, 2))


def record(name: str, channel: str, values: list[float], scale: float, offset: float) -> None:
    """physical = volts · scale + offset, with 2 mV of noise."""
    time, physical = staircase(values)
    noise = np.random.default_rng(SEED).normal(0.0, 2e-3, time.size)
    stream = ChannelReadings(channel, stamps(START, time), (physical - offset) / scale + noise)
    write(Path(name), [stream], load(packaged()), RunInfo(name=channel))


record("pot.mcap", "sinkage_pot", [0.0, 0.010, 0.020, 0.050], 0.02512, -0.01263)  # [m]
record("shunt.mcap", "motor_shunt", [0.0, 1.0, 2.0, 0.0], 2.013, -5.021)  # [A]
