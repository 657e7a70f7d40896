"""What a prediction is off by for the errors of what drives it: motion and measured load.

Speeds, and loads where some run does not state its weights, are measured with noise. A prediction
that is driven by them has that noise in it, and what was measured does not follow it. So a residual
goes with the noise, and any effect with a slope along the speed would be credited for it (errors in
variables: Fuller 1987, Measurement Error Models, ch. 1). How much of the unrest of a speed is noise
is left to every fit: the wheel may truly have moved so. Of a load four things are: the zero of its
sensor, how much of its quick changes are noise, how much of its slow ones, and by how much the mean
of each run is off.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.ndimage import median_filter

from gritd.estimator.config.settings import Settings
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Bools, Channels, Constant, Predict
from gritd.tools.diagnose.rig.recorded import Recorded
from gritd.tools.diagnose.rig.weights import Weights
from gritd.tools.diagnose.tuning import TUNING

Parts = Sequence[Array | float]  # of each run, relative errors (n,) of a speed or of the load


def errors_of_motion(
    predict: Predict, constants: Sequence[Constant], data: Recorded, settings: Settings
) -> tuple[list[Channels], list[list[Channels]]]:
    """See interface.Rig: motion_sigma, and those of its nuisances that are the motion's.

    By the encoders' counts slip is uncertain by what a carriage would make of it that is off by as
    much. A measured load has noise, where it drives the balance.
    """
    by_carriage = _by(predict, constants, "carriage_scale")
    doubt = [signals.doubt for signals in data.signals]
    sigma = _moved([{c: np.abs(v) for c, v in run.items()} for run in by_carriage], doubt)

    wheel, carriage = zip(*map(unrest_of, data.motions), strict=True)  # slip follows their ratio
    unrest = [_moved(by_carriage, wheel), _moved(by_carriage, [-part for part in carriage])]
    if data.stated:
        return sigma, unrest

    zero = 0.0 if settings.wrench is None else settings.wrench.load.offset.sigma
    by_load = _by(predict, constants, "weights")
    noise = _moved(by_load, [_relative(one.sigma, one) for one in data.weights])
    sigma = [
        {c: np.hypot(own[c], more[c]) for c in own} for own, more in zip(sigma, noise, strict=True)
    ]
    return sigma, [*unrest, *(_moved(by_load, parts) for parts in _of_load(data.weights, zero))]


def _by(predict: Predict, constants: Sequence[Constant], name: str) -> list[dict[str, Array]]:
    """Per run, change of every channel (n,) by a relative constant."""
    moved = np.array([float(constant.name == name) for constant in constants])
    pairs = zip(predict(0.0 * moved, ()), predict(moved, ()), strict=True)
    sigma = next(constant.sigma for constant in constants if constant.name == name)
    return [{c: (two[c] - one[c]) / sigma for c in one} for one, two in pairs]


def _moved(changes: Sequence[Channels], parts: Parts) -> list[Channels]:
    pairs = zip(changes, parts, strict=True)
    return [{channel: change * part for channel, change in run.items()} for run, part in pairs]


# ---- speeds --------------------------------------------------------------------------------------


def unrest_of(motion: Motion) -> tuple[Array, Array]:
    """Relative unrest (n,) of the wheel's speed and of the carriage's."""
    wheel, carriage = np.abs(motion.wheel_speed), np.abs(motion.carriage_speed)
    return _unrest(wheel, wheel > 0.0), _unrest(carriage, (wheel > 0.0) & (carriage > 0.0))


def _unrest(speed: Array, moving: Bools) -> Array:
    """ln speed (n,) beside the median of its neighbours; 0 at rest, where it is so much more than
    usual that the motion itself changes, and in a run whose speed is never held.
    """
    if moving.sum() < TUNING.rig.unrest_values:
        return np.zeros(speed.size)

    logarithm = np.log(np.where(moving, speed, 1.0))
    beside = logarithm - median_filter(logarithm, TUNING.rig.unrest_values, mode="nearest")
    usual = float(np.median(np.abs(beside[moving])))
    if usual > TUNING.rig.unrest_largest:
        return np.zeros(speed.size)

    counts = moving & (np.abs(beside) <= TUNING.rig.unrest_most * usual)
    return np.where(counts, beside, 0.0)


# ---- load ----------------------------------------------------------------------------------------


def _of_load(weights: Sequence[Weights], zero: float) -> Iterator[Parts]:
    """Each error of the measured loads. zero: standard deviation of the sensor's zero [N]."""
    yield [0.0 if one.load is None else _relative(zero, one) for one in weights]
    none = (0.0, 0.0)
    changes = [none if one.load is None else changes_of(one.values) for one in weights]
    for parts in zip(*changes, strict=True):
        yield [-part for part in parts]
    for number, one in enumerate(weights):
        if one.load is not None:
            own = error_of_level(one.load)
            yield [own * (run == number) for run in range(len(weights))]


def changes_of(load: Array) -> tuple[Array, Array]:
    """Relative changes (n,) of a load (n,) that may be noise: quick ones beside its neighbours, and
    slow ones beside the run's level; 0 where other weights hang on the axle, or none.
    """
    level = _level(load)
    near = np.abs(load - level) <= TUNING.rig.other_weights * level
    logarithm = np.log(np.where(near, load, level))
    slow = median_filter(logarithm, TUNING.rig.unrest_values, mode="nearest")
    quick = np.where(near, logarithm - slow, 0.0)
    return quick, np.where(near, slow - np.log(level), 0.0)


def error_of_level(load: Array) -> float:
    """Relative standard deviation of a run's mean load from a measured load (n,), whatever the
    colour of its noise: by the means of parts of the run.
    """
    level = _level(load)
    near = load[np.abs(load - level) <= TUNING.rig.other_weights * level]
    if near.size < TUNING.rig.load_parts:
        return 0.0
    means = [float(part.mean()) for part in np.array_split(near, TUNING.rig.load_parts)]
    return float(np.std(means, ddof=1) / np.sqrt(len(means))) / level


def _level(load: Array) -> float:
    """Median while the wheel carries."""
    return float(np.median(load[load > TUNING.rig.lifted * load.max()]))


def _relative(error: Array | float, weights: Weights) -> Array:
    """An error (n,) [N] of measured weights as a share of them; nothing where the wheel is
    lifted.
    """
    carried = weights.values > TUNING.rig.lifted * weights.values.max()
    return np.where(carried, error / np.where(carried, weights.values, 1.0), 0.0)
