"""The weights on the axle in each run: as the run states them, or as the force/torque sensor tells
them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gritd.estimator.config.settings import Calibration, Settings, Uncertain
from gritd.estimator.offline.windows import NORMAL
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.tuning import TUNING

MEASURED_NOTE = (
    "Weights are taken from the measured load in runs that do not state theirs or that change"
    " them: friction of the load axis cannot show there."
)


class Weights(NamedTuple):
    values: Array  # (n,) [N]
    known: bool  # stated, so that the measured load can be compared with them
    load: Array | None = None  # (n,) [N] as it was measured, where they are taken from it


def weights_of(signals: Signals, settings: Settings) -> Weights:
    """Stated weights where the measured load does not contradict them, else the levels of the
    measured load.

    A run that states nothing has the configuration's weights, if the measured load is theirs within
    the uncertainties.
    """
    nominal = signals.info.nominal_load
    stated = settings.load.nominal.value if nominal is None else nominal
    constant = np.full(signals.time.size, float(stated))

    measured = signals.analogue.get("load")
    if (
        measured is None
        or settings.wrench is None
        or settings.wrench.load.offset.sigma > TUNING.rig.unknown_offset
    ):
        return Weights(constant, True)

    load = _bridged(measured)
    near, lifted = (
        np.abs(load - stated) <= TUNING.rig.close_load * stated + TUNING.rig.close_force,
        load <= TUNING.rig.raised * stated,
    )

    held = float(np.median(load[~lifted])) if not lifted.all() else 0.0
    known = nominal is not None or abs(held - stated) <= TUNING.rig.load_doubt * _sigma(
        settings.load.nominal, settings.wrench.load
    )
    if (
        known
        and np.mean(near | lifted) >= 1.0 - TUNING.rig.passing
        and np.mean(near) > np.mean(lifted)
    ):
        return Weights(np.where(load > TUNING.rig.carried * stated, constant, 0.0), True)

    return Weights(levels(signals.time, load), False, load)


def _sigma(nominal: Uncertain, sensor: Calibration) -> float:
    """Of the configured weights beside the sensor that measures them [N]."""
    gain = sensor.scale.sigma / sensor.scale.value * nominal.value
    return float(np.sqrt(nominal.sigma**2 + gain**2 + sensor.offset.sigma**2))


def levels(time: Array, load: Array) -> Array:
    """The measured load (n,) [N]: its mean over each stretch on which it is level, else as it was
    measured.
    """
    step = float(np.median(np.diff(time)))
    half = max(round(0.5 * TUNING.rig.hold / step), 1)
    padded = np.pad(load, half, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    slack = TUNING.rig.load_level * np.abs(load) + TUNING.rig.load_noise * _noise(load)

    level = np.ptp(windows, axis=1) <= slack
    local = windows.mean(axis=1)
    out = np.where(level, local, load)

    for stretch in np.split(np.arange(load.size), np.flatnonzero(np.diff(level.astype(int))) + 1):
        if level[stretch[0]] and np.ptp(local[stretch]) <= slack[stretch].mean():
            out[stretch] = load[stretch].mean()
    return out


def _noise(values: Array) -> float:
    return float(NORMAL * np.median(np.abs(np.diff(values))) / np.sqrt(2.0))


def _bridged(values: Array) -> Array:
    good = np.isfinite(values)
    at = np.arange(values.size)
    return np.interp(at, at[good], values[good])
