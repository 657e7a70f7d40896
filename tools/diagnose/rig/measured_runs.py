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
from gritd.tools.diagnose.rig.interface import Bools, GridRun
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
    idle: Bools | None,
    tabled: bool,
) -> GridRun:
    """One run.

    sinkage: the predicted one (n,) [m], as a covariate.
    idle:    where channel torque is motor torque less axle torque, the values (n,) at which it is
             the motor's alone; else None.
    tabled:  whether the recordings are tables of steady states.
    """
    constant = settings.drive.torque_constant.value
    measured = {c: measured_of(signals, c, constant) for c in channels}
    if idle is not None:
        axle = np.where(idle, 0.0, measured["axle_torque"])
        measured["torque"] = measured["torque"] - axle

    along = covariates(signals, motion, settings.wheel, tabled)
    along["sinkage"] = sinkage

    driving, resting, lifted = states(motion, settings)
    turned = np.zeros(driving.size, bool) if tabled else turned_back(motion, settings)
    still = {"torque": driving | resting | lifted | turned}
    alone = np.zeros(driving.size, bool) if idle is None else idle
    if idle is not None:
        still["axle_torque"] = driving | idle
    known = np.isfinite(signals.wheel_speed) & np.isfinite(signals.carriage_rate)
    known[: TUNING.rig.slope_edge] = known[-TUNING.rig.slope_edge :] = False

    used = {c: known & still.get(c, driving) & np.isfinite(measured[c]) for c in channels}
    marks = (alone.astype(float), (turned & ~driving).astype(float))
    return GridRun(signals.name, np.asarray(motion.time), measured, used, along, *marks)


def idle_values(
    signals: Sequence[Signals], motions: Sequence[Motion], settings: Settings
) -> list[Bools]:
    """Where the wheel stands or is lifted, and the axle's torque is nil; (n,) of each run. What the
    motor draws there it loses, and the noise of the axle's sensor need not be added to it.
    """
    axles = [np.nan_to_num(measured_of(one, "axle_torque", 1.0)) for one in signals]
    every = [states(motion, settings) for motion in motions]
    driven = np.concatenate([a[driving] for a, (driving, _, _) in zip(axles, every, strict=True)])
    least = TUNING.rig.holding * float(np.sqrt(np.mean(driven**2))) if driven.size else 0.0

    made = []
    for axle, (_, resting, lifted) in zip(axles, every, strict=True):
        idle = np.zeros(axle.size, bool)
        for state in (resting, lifted):
            edges = np.flatnonzero(np.diff(state.astype(int), prepend=0, append=0))
            for first, end in edges.reshape(-1, 2):
                idle[first:end] = abs(float(np.mean(axle[first:end]))) < least
        made.append(idle)
    return made


def sinkage_from_prior(
    motion: Motion, settings: Settings, soil: Soil, effects: Sequence[Effect]
) -> Array:
    """Sinkage (n,) [m] predicted from the prior: the measured one carries its channel's noise."""
    return simulate_arrays(
        settings.wheel, soil, motion, effects, order=TUNING.rig.quadrature_order
    ).sinkage


def torque_is_held(runs: Sequence[GridRun]) -> bool:
    """Whether a servo holds torque at rest: the current at rest differs from rest to rest, by more
    than its noise, so it tells nothing.
    """
    torque, rest = [run.measured["torque"] for run in runs], [_resting(run) for run in runs]
    rests = [values[at] for values, at in zip(torque, rest, strict=True) if at.any()]
    means = [float(values.mean()) for values in rests]
    noise = max((float(v.std() / np.sqrt(v.size)) for v in rests), default=0.0)

    driven = np.concatenate(
        [
            values[run.used["torque"] & ~at]
            for run, values, at in zip(runs, torque, rest, strict=True)
        ]
    )
    if len(means) < 2 or not driven.size:
        return False
    usual = float(np.sqrt(np.mean(driven**2)))
    least = max(TUNING.rig.holding * usual, TUNING.rig.doubt * noise)
    return float(np.ptp(means)) >= least


def without_torque_at_rest(runs: Sequence[GridRun]) -> list[GridRun]:
    """The runs, in which no torque counts while the wheel stands."""
    made = []
    for run in runs:
        moving = run.covariates["speed"] != 0.0
        torques = {c: run.used[c] & moving for c in ("torque", "axle_torque") if c in run.used}
        made.append(replace(run, used={**run.used, **torques}))
    return made


def _resting(run: GridRun) -> Bools:
    """Values (n,) of the torque that count, at which the wheel stands."""
    resting: Bools = run.used["torque"] & (run.covariates["speed"] == 0.0)
    return resting
