"""The runs of a wheel on the analysis grid: what was measured, and which values count."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.effects.base import Effect
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.tools.diagnose.rig.covariates import covariates
from gritd.tools.diagnose.rig.interface import Bools, Run
from gritd.tools.diagnose.rig.recorded import measured_of
from gritd.tools.diagnose.rig.signals import Signals
from gritd.tools.diagnose.rig.states import states, turned_back
from gritd.tools.diagnose.tuning import TUNING

HOLDING_NOTE = (
    "The motor holds torque while the wheel stands, so its current at rest tells no offset."
)


def measured_run(
    signals: Signals,
    motion: Motion,
    settings: Settings,
    channels: Sequence[str],
    sinkage: Array,
    loss_of_drive: bool,
    tabled: bool,
) -> Run:
    """One run.

    sinkage:       the predicted one (n,) [m], as a covariate.
    loss_of_drive: whether channel torque is motor torque less axle torque.
    tabled:        whether the recording is a table of steady states.
    """
    constant = settings.drive.torque_constant.value
    measured = {c: measured_of(signals, c, constant) for c in channels}
    if loss_of_drive:
        measured["torque"] = measured["torque"] - measured["axle_torque"]

    along = covariates(signals, motion, settings.wheel, tabled)
    along["sinkage"] = sinkage

    driving, resting, lifted = states(motion, settings)
    still = {"torque": driving | resting | lifted}
    if loss_of_drive:
        still["torque"] |= turned_back(motion, settings)
    known = np.isfinite(signals.wheel_speed) & np.isfinite(signals.carriage_rate)
    known[: TUNING.rig.slope_edge] = known[-TUNING.rig.slope_edge :] = False

    used = {c: known & still.get(c, driving) & np.isfinite(measured[c]) for c in channels}
    return Run(signals.name, np.asarray(motion.time), measured, used, along)


def sinkage_from_prior(
    motion: Motion, settings: Settings, soil: Soil, effects: Sequence[Effect]
) -> Array:
    """Sinkage (n,) [m] predicted from the prior: the measured one carries its channel's noise."""
    return simulate_arrays(
        settings.wheel, soil, motion, effects, order=TUNING.rig.quadrature_order
    ).sinkage


def torque_is_held(runs: Sequence[Run]) -> bool:
    """Whether a servo holds torque at rest: the current at rest differs from rest to rest, so it
    tells nothing.
    """
    torque, rest = [run.measured["torque"] for run in runs], [_resting(run) for run in runs]
    means = [float(values[at].mean()) for values, at in zip(torque, rest, strict=True) if at.any()]

    driven = np.concatenate(
        [
            values[run.used["torque"] & ~at]
            for run, values, at in zip(runs, torque, rest, strict=True)
        ]
    )
    if len(means) < 2 or not driven.size:
        return False
    usual = float(np.sqrt(np.mean(driven**2)))
    return float(np.ptp(means)) >= TUNING.rig.holding * usual


def without_torque_at_rest(runs: Sequence[Run]) -> list[Run]:
    """The runs, in which the torque does not count while the wheel stands."""
    return [
        replace(run, used={**run.used, "torque": run.used["torque"] & ~_resting(run)})
        for run in runs
    ]


def _resting(run: Run) -> Bools:
    """Values (n,) of the torque that count, at which the wheel stands."""
    resting: Bools = run.used["torque"] & (run.covariates["speed"] == 0.0)
    return resting
