"""The weights on the axle in each run: as the run states them, or as the force/torque sensor tells them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from estimator.settings import Settings
from estimator.terramechanics.soil import Array
from tools.diagnose.load import Signals

CLOSE = 0.15  # relative distance of the measured load from the stated one at which both mean the same
RAISED = 0.2  # share of the stated load below which the wheel is lifted
PASSING = 0.1  # share of a run that may pass between lifted and loaded
LEVEL = 0.03  # relative change of the measured load that is a change of weights
HOLD = 1.0  # [s] weights stay for at least this long


class Weights(NamedTuple):
    values: Array  # (n,) [N]
    known: bool  # stated, so that the measured load can be compared with them


def weights_of(signals: Signals, settings: Settings, caveats: list[str]) -> Weights:
    """Stated weights where the measured load does not contradict them, else the levels of the measured load."""
    stated = signals.info.nominal_load if signals.info.nominal_load is not None else settings.load.nominal.value
    constant = np.full(signals.time.size, float(stated))
    measured = signals.analogue.get("load")
    if measured is None or settings.wrench is None or settings.wrench.load.offset.sigma > 1e5:
        return Weights(constant, True)
    load = _bridged(measured)
    near, lifted = np.abs(load - stated) <= CLOSE * stated + 1.0, load <= RAISED * stated
    if np.mean(near | lifted) >= 1.0 - PASSING and np.mean(near) > np.mean(lifted):
        return Weights(np.where(load > 0.5 * stated, constant, 0.0), True)
    note = (
        "Weights change within a run, so they are taken from the measured load: friction of the load axis cannot show."
    )
    if note not in caveats:
        caveats.append(note)
    return Weights(levels(signals.time, load), False)


def levels(time: Array, load: Array) -> Array:
    """The measured load: its mean over each stretch on which it is level, as measured where it changes."""
    step = float(np.median(np.diff(time)))
    half = max(round(0.5 * HOLD / step), 1)
    padded = np.pad(load, half, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    slack = LEVEL * np.abs(load) + 6.0 * _noise(load)
    level = np.ptp(windows, axis=1) <= slack
    local = windows.mean(axis=1)
    out = np.where(level, local, load)
    for stretch in np.split(np.arange(load.size), np.flatnonzero(np.diff(level.astype(int))) + 1):
        if level[stretch[0]] and np.ptp(local[stretch]) <= slack[stretch].mean():
            out[stretch] = load[stretch].mean()
    return out


def _noise(values: Array) -> float:
    return float(1.4826 * np.median(np.abs(np.diff(values))) / np.sqrt(2.0))


def _bridged(values: Array) -> Array:
    good = np.isfinite(values)
    at = np.arange(values.size)
    return np.interp(at, at[good], values[good])
