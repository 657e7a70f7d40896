"""By how much averages and slopes of a moving wheel blur what is compared."""

from __future__ import annotations

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.noise.replicates import repeats
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING


def blur_of(stack: Stack, predicted: Array) -> Array:
    """Error (N,) where a prediction (N,) changes, in the channels' units; nothing where prediction
    and recording go through the same filter, nor between the steady states of a table.

    Averaging takes a share of the second difference, a value's or its neighbours'; and a lagging
    axle shifts all forces by the share by which the sinkage changes within the lag. While the motor
    stands idle nothing changes, next to a start neither.

    A run that is repeated errs in the same way again: as the error of one reading in each of them
    it is so much larger that all of them tell what one does.
    """
    if stack.rig.filtered or stack.rig.tabled:
        return np.zeros(stack.size)
    bend = np.abs(np.diff(predicted, n=2, prepend=predicted[:1], append=predicted[-1:]))
    edge = ~np.isfinite(stack.gaps) | ~np.isfinite(np.append(stack.gaps[1:], np.inf))

    late = np.abs(np.diff(predicted, prepend=predicted[:1])) / stack.gaps
    depth = np.log(np.maximum(stack.covariate("sinkage"), TUNING.noise.shallow))
    late = late + np.abs(predicted * np.diff(depth, prepend=depth[:1])) / stack.gaps

    bent = TUNING.noise.bend * _nearby(np.where(edge, 0.0, bend))
    again: Array = np.sqrt(repeats(stack))[stack.run]
    blur = np.hypot(bent, TUNING.noise.lag * _nearby(late)) * again
    blur = np.where(stack.idle & (stack.covariate("speed") == 0.0), 0.0, blur)
    return np.hypot(blur, _of_reversal(stack, predicted))


def _of_reversal(stack: Stack, predicted: Array) -> Array:
    """Error (N,) of channel torque [N·m] after a reversal: that falls inside an interval, and soil
    takes the axle's torque up over some way. A part of that is open.
    """
    rig, axle = stack.rig, np.abs(predicted)
    if "axle_torque" in rig.channels:
        read = [np.abs(run.measured["axle_torque"]) for run in rig.runs]
        known = stack.joined([dict.fromkeys(rig.channels, values) for values in read])
        axle = np.where(np.isfinite(known), known, axle)
    return np.where(stack.turned & stack.of("torque"), TUNING.noise.taken_up * axle, 0.0)


def _nearby(values: Array) -> Array:
    """The largest of each value and its neighbours."""
    return np.maximum(values, np.maximum(np.roll(values, 1), np.roll(values, -1)))
