"""Where the form of a wheel's model may be off, and over which conditions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gritd.estimator.effects.contact_relaxation import SHALLOW, USUAL
from gritd.estimator.model.discrepancy import CARRYING, Usual, conditions_of, weight_of
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import FormSource, GridRun

SOURCES = (  # name, channels that share one discrepancy, whether it turns with the direction
    ("torque", ("torque", "axle_torque"), True),
    ("drawbar_pull", ("drawbar_pull",), True),
    ("sinkage", ("sinkage",), False),
)


def wheel_forms(
    runs: Sequence[GridRun],
    channels: Sequence[str],
    radius: float,
    driven: Sequence[Array] | None = None,
) -> tuple[FormSource, ...]:
    """The sources of a wheel rig.

    driven: the motor's torque (n,) of every run [N·m], where channel `torque` is what is lost
    between motor and axle: no soil acts there, but the drive has a discrepancy of its own.
    """
    usual = usual_of(runs)
    if usual is None:
        return ()

    conditions = tuple(conditions_in(run, usual, radius) for run in runs)
    ways = tuple(_ways(run, radius) for run in runs)
    forms = []
    for name, both, signed in SOURCES:
        lost = ("torque",) if driven is not None else ()
        measured = tuple(c for c in both if c in channels and c not in lost)
        if measured:
            weight = tuple(_weight(run, usual, signed) for run in runs)
            forms.append(
                FormSource(
                    name, measured, conditions, weight, usual=usual, ways=ways, signed=signed
                )
            )

    if driven is not None:
        weight = tuple(_weight(run, usual, True) for run in runs)
        size = _mean_square([t[w != 0.0] for t, w in zip(driven, weight, strict=True)]) ** 0.5
        forms.append(FormSource("drive", ("torque",), conditions, weight, size, drive=True))
    return tuple(forms)


def _mean_square(parts: Sequence[Array]) -> float:
    values = np.concatenate(parts)
    values = values[np.isfinite(values)]
    return float(np.mean(values**2)) if values.size else 0.0


def usual_of(runs: Sequence[GridRun]) -> Usual | None:
    """Geometric means of load and rim speed while the wheel drives; None where it never does."""
    load, speed = (np.concatenate([r.covariates[n] for r in runs]) for n in ("load", "speed"))
    driving = (speed > 0.0) & (load > 0.0)
    if not driving.any():
        return None
    driving &= load > CARRYING * np.median(load[driving])
    return Usual(
        float(np.exp(np.mean(np.log(load[driving])))),
        float(np.exp(np.mean(np.log(speed[driving])))),
    )


def conditions_in(run: GridRun, usual: Usual, radius: float) -> Array:
    """Conditions (n, d) of δ in a run."""
    known = run.covariates
    travel = radius * known["rolled"]
    return conditions_of(
        known["slip"], known["load"], known["speed"], known["direction"], travel, usual
    )


def _ways(run: GridRun, radius: float) -> Array:
    """How far rim and axle have travelled (n, 4): both in m, then in usual contact lengths."""
    known = run.covariates
    ways = np.column_stack((radius * known["rolled"], known["position"]))
    steps = np.abs(np.diff(ways, axis=0, prepend=ways[:1]))
    cos_theta_1 = np.clip(1.0 - known["sinkage"] / radius, 0.0, 1.0)
    contact = np.maximum(np.sqrt(1.0 - cos_theta_1**2), SHALLOW) / USUAL
    return np.cumsum(np.hstack((steps, steps / contact[:, None])), axis=0)


def _weight(run: GridRun, usual: Usual, signed: bool) -> Array:
    """How large δ is at each value (n,): in proportion to the load, 0 where no soil is touched."""
    known = run.covariates
    direction = np.where(known["direction"] < 0.0, -1.0, 1.0)
    return weight_of(known["load"], known["speed"], direction, usual, signed, CARRYING)
