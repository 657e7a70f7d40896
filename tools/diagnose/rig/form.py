"""Where the form of a wheel's model may be off, and over which conditions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gritd.estimator.model.discrepancy import Usual, conditions_of
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import FormSource, Run
from gritd.tools.diagnose.tuning import TUNING

SOURCES = (  # name, channels that share one discrepancy, whether it turns with the direction
    ("torque", ("torque", "axle_torque"), True),
    ("drawbar_pull", ("drawbar_pull",), True),
    ("sinkage", ("sinkage",), False),
)


def wheel_forms(
    runs: Sequence[Run], channels: Sequence[str], radius: float
) -> tuple[FormSource, ...]:
    """The sources of a wheel rig. Soil torque is shared by motor and axle; where both are measured
    the drive between them has a discrepancy of its own.
    """
    usual = usual_of(runs)
    if usual is None:
        return ()
    conditions = tuple(_conditions(run, usual, radius) for run in runs)
    forms = []
    for name, both, signed in SOURCES:
        measured = tuple(c for c in both if c in channels)
        if measured:
            weight = tuple(_weight(run, usual, signed) for run in runs)
            forms.append(FormSource(name, measured, conditions, weight))
    if {"torque", "axle_torque"} <= set(channels):
        weight = tuple(_weight(run, usual, True) for run in runs)
        forms.append(FormSource("drive", ("torque",), conditions, weight, drive=True))
    return tuple(forms)


def usual_of(runs: Sequence[Run]) -> Usual | None:
    """Geometric means of load and rim speed while the wheel drives; None where it never does."""
    load, speed = (np.concatenate([r.covariates[n] for r in runs]) for n in ("load", "speed"))
    driving = (speed > 0.0) & (load > 0.0)
    if not driving.any():
        return None
    driving &= load > TUNING.rig.carrying * np.median(load[driving])
    return Usual(
        float(np.exp(np.mean(np.log(load[driving])))),
        float(np.exp(np.mean(np.log(speed[driving])))),
    )


def _conditions(run: Run, usual: Usual, radius: float) -> Array:
    known = run.covariates
    travel = radius * np.cumsum(
        np.abs(np.diff(known["wheel_angle"], prepend=known["wheel_angle"][0]))
    )
    return conditions_of(
        known["slip"], known["load"], known["speed"], known["direction"], travel, usual
    )


def _weight(run: Run, usual: Usual, signed: bool) -> Array:
    """How large δ is at each value (n,): in proportion to the load, 0 where no soil is touched."""
    known = run.covariates
    share = known["load"] / usual.load
    carrying = (known["speed"] > 0.0) & (share > TUNING.rig.carrying)
    sign = np.where(known["direction"] < 0.0, -1.0, 1.0) if signed else 1.0
    return np.asarray(np.where(carrying, share * sign, 0.0))
