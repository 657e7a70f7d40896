"""The weights on the axle in each run: as the run states them, or as the force/torque sensor tells
them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gritd.estimator.config.settings import Calibration, Settings, Uncertain
from gritd.estimator.offline.windows import NORMAL
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Index
from gritd.tools.diagnose.rig.signals import Signals, filled
from gritd.tools.diagnose.tuning import TUNING

MEASURED_NOTE = (
    "Some run does not state its load or changes it, so weights are taken from the measured load:"
    " friction of the load axis cannot show. It can where every run states one load."
)


class Weights(NamedTuple):
    values: Array  # (n,) [N] what the wheel is driven with
    load: Array | None = None  # (n,) [N] as it was measured, where they are taken from it
    sigma: Array | float = 0.0  # (n,) [N] of the values, by the noise of the sensor

    @property
    def known(self) -> bool:
        """Whether they are stated, so that the measured load can be compared with them."""
        return self.load is None


def weights_in(signals: Sequence[Signals], settings: Settings) -> list[Weights]:
    """Those of all runs: as they are stated, or as they are measured where they were. Where
    friction of the axis cannot show in one run, it must not act in the others.
    """
    every = [weights_of(one, settings) for one in signals]
    if all(one.known for one in every):
        return every
    return [_measured(one, settings) or w for one, w in zip(signals, every, strict=True)]


def weights_of(signals: Signals, settings: Settings) -> Weights:
    """Stated weights where the measured load does not contradict them, else the measured ones.

    A run that states nothing has the configuration's weights, if the measured load is theirs within
    the uncertainties.
    """
    nominal = signals.info.nominal_load
    stated = settings.load.nominal.value if nominal is None else nominal
    constant = np.full(signals.time.size, float(stated))

    measured = _measured(signals, settings)
    if measured is None or measured.load is None or settings.wrench is None:
        return Weights(constant)

    load = measured.load
    apart = TUNING.rig.close_load * stated + TUNING.rig.doubt * _noise(load)
    near, lifted = np.abs(load - stated) <= apart, load <= TUNING.rig.lifted * stated

    held = float(np.median(load[~lifted])) if not lifted.all() else 0.0
    doubt = TUNING.rig.doubt * _sigma(settings.load.nominal, settings.wrench.load)
    known = nominal is not None or abs(held - stated) <= doubt
    mostly = np.mean(near | lifted) >= 1.0 - TUNING.rig.passing and np.mean(near) > np.mean(lifted)
    return Weights(np.where(load > 0.5 * stated, constant, 0.0)) if known and mostly else measured


def _measured(signals: Signals, settings: Settings) -> Weights | None:
    """Those that the force sensor tells; none without a sensor of known zero, or where it was
    silent for most of the run.
    """
    measured, wrench = signals.analogue.get("load"), settings.wrench
    if measured is None or wrench is None:
        return None
    silent = np.mean(np.isfinite(measured)) < 0.5
    if silent or wrench.load.offset.sigma > TUNING.rig.unknown_offset:
        return None

    load = filled(measured)
    if signals.info.steady_states:  # one after the other, they have nothing in common
        values, sigma = _of_rows(signals, load)
    else:
        values, sigma = felt(signals.time, load)
    return Weights(values, load, sigma)


def _sigma(nominal: Uncertain, sensor: Calibration) -> float:
    """Of the configured weights beside the sensor that measures them [N]."""
    gain = sensor.scale.sigma / sensor.scale.value * nominal.value
    return float(np.sqrt(nominal.sigma**2 + gain**2 + sensor.offset.sigma**2))


def _of_rows(signals: Signals, load: Array) -> tuple[Array, Array]:
    """The mean load of each row of a table, and what it scatters by, at its values (n,): see
    `felt`.
    """
    values, sigma = load.copy(), np.zeros(load.size)
    known = np.flatnonzero(np.isfinite(signals.wheel_speed) & np.isfinite(signals.carriage_rate))
    rows = np.split(known, np.flatnonzero(np.diff(known) > 1) + 1)  # silence parts them
    for row in (at for at in rows if at.size):
        values[row] = load[row].mean()
        sigma[row] = load[row].std()
    return values, sigma


def felt(time: Array, load: Array) -> tuple[Array, Array]:
    """What the wheel feels (n,) [N] of a measured load (n,), and its standard deviation (n,) [N].

    Of each value it is the mean over the longest moment whose mean is, within the noise, that of
    every shorter one (intersection of confidence intervals: Goldenshluger, Nemirovski 1997, Math.
    Methods Statist. 6, 135-170). By what the mean over half of it differs, it may be bent. The
    sensor sits beside the wheel, so friction of the axis is in it.

    The error of a mean over m values is shared by about m values. As the error of one reading in
    each of them it tells as much of what they have in common, and that is what is reported.
    """
    noise, count = _noise(load), np.arange(_half(time) + 1)
    means = np.array([_moments(load, half).mean(axis=1) for half in range(count.size)])
    sigma = noise / np.sqrt(2.0 * count + 1.0)
    within = TUNING.rig.load_moment * sigma[:, None]
    low = np.maximum.accumulate(means - within, axis=0)
    high = np.minimum.accumulate(means + within, axis=0)
    longest, at = np.sum(low <= high, axis=0) - 1, np.arange(load.size)

    mean, shorter = means[longest, at], means[longest // 2, at]
    apart = np.abs(mean - shorter)
    chance = TUNING.rig.load_moment * np.sqrt(sigma[longest // 2] ** 2 - sigma[longest] ** 2)
    bent = _moments(np.where(apart > chance, apart, 0.0), _half(time)).max(axis=1)
    return mean, np.hypot(noise, bent)


def _half(time: Array) -> int:
    """Values (n,) on each side of one that belong to its moment."""
    return max(round(0.5 * TUNING.rig.hold / float(np.median(np.diff(time)))), 1)


def _moments(load: Array, half: int) -> Array:
    """The values about each of a load (n, 2 half + 1)."""
    return np.lib.stride_tricks.sliding_window_view(np.pad(load, half, mode="edge"), 2 * half + 1)


def _noise(values: Array) -> float:
    """Standard deviation of the noise, by the differences of neighbours; at least that of a
    rounding to the smallest step.
    """
    steps = np.abs(np.diff(values))
    rounding = float(steps[steps > 0.0].min() / np.sqrt(12.0)) if np.any(steps) else 0.0
    return max(float(NORMAL * np.median(steps) / np.sqrt(2.0)), rounding)


# ---- sets of weights: what hangs on the axle is one for each load, and each errs for itself ------


@dataclass(frozen=True)
class WeightSets:
    """Loads (m,) of the sets [N]; which of them each value has, per run (n,), −1 for none."""

    loads: tuple[float, ...]
    label: tuple[Index, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"weights_{load:.4g}" for load in self.loads)


def weight_sets(weights: Sequence[Weights]) -> WeightSets:
    """The sets in use, from the weights of each run that states them; none where all have the same:
    of measured ones the sensor errs, and not each set for itself.
    """
    loads = [w.values if w.known else np.zeros_like(w.values) for w in weights]
    values, count = np.unique(np.concatenate(loads), return_counts=True)
    held = values[(count >= TUNING.rig.encoder_readings) & (values > 0.0)]
    sets = np.split(held, np.flatnonzero(np.diff(np.log(held)) > TUNING.rig.scale_floor) + 1)
    if not 1 < len(sets) <= TUNING.noise.most_cells:
        none = tuple(np.full(load.size, -1, dtype=np.intp) for load in loads)
        return WeightSets((), none)
    middle = np.array([one.mean() for one in sets])
    return WeightSets(tuple(middle.tolist()), tuple(_nearest(load, middle) for load in loads))


def _nearest(load: Array, middle: Array) -> Index:
    apart = np.abs(load[:, None] / middle - 1.0)
    return np.where(apart.min(axis=1) <= TUNING.rig.scale_floor, apart.argmin(axis=1), -1)
