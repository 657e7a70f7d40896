"""What a prediction is off by for the errors of what drives it: motion and measured load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Channels, Constant, Predict
from gritd.tools.diagnose.rig.load_error import load_errors_in
from gritd.tools.diagnose.rig.unrest import unrest_in
from gritd.tools.diagnose.rig.weights import Weights
from gritd.tools.diagnose.tuning import TUNING


@dataclass(frozen=True, eq=False)
class MotionErrors:
    """See interface.Rig: `motion_sigma` and `unrest`."""

    sigma: Sequence[Channels]
    unrest: Sequence[Sequence[Channels]]


def errors_of_motion(
    predict: Predict,
    constants: Sequence[Constant],
    motions: Sequence[Motion],
    weights: Sequence[Weights],
    doubt: Sequence[Array],
) -> MotionErrors:
    """By the encoders' counts slip is uncertain by what a carriage would make of it that is off by
    as much, `doubt` (n,) of each run. A measured load has noise, where it drives the balance.
    """
    by_carriage = _by(predict, constants, "carriage_scale")
    sigma = [
        {channel: np.abs(change) * one for channel, change in by_speed.items()}
        for by_speed, one in zip(by_carriage, doubt, strict=True)
    ]
    unrest = unrest_in(motions, by_carriage)
    if all(one.known for one in weights):
        return MotionErrors(sigma, unrest)

    by_load = _by(predict, constants, "weights")
    told = zip(sigma, by_load, map(_relative_noise, weights), strict=True)
    sigma = [{c: np.hypot(own[c], by[c] * noise) for c in own} for own, by, noise in told]
    return MotionErrors(sigma, [*unrest, *load_errors_in(weights, by_load)])


def _by(predict: Predict, constants: Sequence[Constant], name: str) -> list[dict[str, Array]]:
    """Per run, change of every channel (n,) by a relative constant."""
    moved = np.array([float(constant.name == name) for constant in constants])
    told = zip(predict(0.0 * moved, ()), predict(moved, ()), strict=True)
    sigma = next(constant.sigma for constant in constants if constant.name == name)
    return [{c: (two[c] - one[c]) / sigma for c in one} for one, two in told]


def _relative_noise(weights: Weights) -> Array:
    """Of measured weights (n,); nothing where the wheel is lifted."""
    carried = weights.values > TUNING.rig.lifted * weights.values.max()
    return np.where(carried, weights.sigma / np.where(carried, weights.values, 1.0), 0.0)
