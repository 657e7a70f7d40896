"""What of the measured motion may be noise and not motion.

Speeds are measured with noise, and a prediction that is driven by them has that noise in it. What
was measured does not follow it. So a residual goes with the noise of the speeds, and any effect
with a slope along the speed would be credited for it (errors in variables: Fuller 1987, Measurement
Error Models, ch. 1). How much of the unrest of a speed is noise is left to the fit: the wheel may
truly have moved so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.ndimage import median_filter

from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Bools
from gritd.tools.diagnose.tuning import TUNING


def unrest_in(
    motions: Sequence[Motion], by_carriage: Sequence[Mapping[str, Array]]
) -> list[list[dict[str, Array]]]:
    """Of the wheel and of the carriage, per run, what every channel (n,) is predicted too low by if
    their unrest is noise. Slip follows the ratio of their speeds.

    by_carriage: per run, change of every channel (n,) by ln of the carriage's speed.
    """
    each = zip(*(unrest_of(motion) for motion in motions), strict=True)

    return [
        [
            {channel: sign * change * part for channel, change in by_speed.items()}
            for by_speed, part in zip(by_carriage, parts, strict=True)
        ]
        for sign, parts in zip((1.0, -1.0), each, strict=True)
    ]


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
