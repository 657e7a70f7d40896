"""The runs of a wheel on the analysis grid: what was measured, and which values count."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gritd.estimator.config.effects import configured
from gritd.estimator.config.settings import Settings
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.stages.situation import Motion, situation_of
from gritd.estimator.terramechanics.soil import Array, Soil, Wheel
from gritd.tools.diagnose.rig.constants import SOIL
from gritd.tools.diagnose.rig.interface import Bools, Constant, GridRun
from gritd.tools.diagnose.rig.recorded import Recorded, measured_of
from gritd.tools.diagnose.rig.signals import Signals, filled
from gritd.tools.diagnose.rig.states import states, turned_back, turning
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import LONG_AGO

COURSE = ("wheel_angle", "position", "sliding", "time", "acceleration", "heat")
HOLDING_NOTE = (
    "The motor holds torque while the wheel stands, so its current at rest tells no offset."
)


def measured_runs(
    data: Recorded, settings: Settings, constants: Sequence[Constant]
) -> list[GridRun]:
    """settings: with all effects that both campaigns have."""
    prior = {constant.name: constant.value for constant in constants}
    soil, effects = Soil(*(prior[name] for name in SOIL)), configured(settings.effects)
    order = TUNING.rig.quadrature_order

    runs = []
    for number, motion in enumerate(data.motions):
        # the predicted sinkage [m], as a covariate: the measured one carries its channel's noise
        predicted = simulate_arrays(settings.wheel, soil, motion, effects, order=order).sinkage
        runs.append(_measured_run(data, number, settings, predicted))
    return runs


def _measured_run(data: Recorded, number: int, settings: Settings, sinkage: Array) -> GridRun:
    signals, motion = data.signals[number], data.motions[number]
    idle = None if data.idle is None else data.idle[number]
    constant = settings.drive.torque_constant.value
    measured = {c: measured_of(signals, c, constant) for c in data.channels}
    if idle is not None:
        axle = np.where(idle, 0.0, measured["axle_torque"])
        measured["torque"] = measured["torque"] - axle

    along = covariates(signals, motion, settings.wheel, data.tabled)
    along["sinkage"] = sinkage

    driving, resting, lifted = states(motion, settings)
    turned = np.zeros(driving.size, bool) if data.tabled else turned_back(motion, settings)
    still = {"torque": driving | resting | lifted | turned}
    alone = np.zeros(driving.size, bool) if idle is None else idle
    if idle is not None:
        still["axle_torque"] = driving | idle
    if idle is not None and not data.tabled:  # what is lost needs no soil that has settled
        still["torque"] |= turning(motion, settings)
    known = np.isfinite(signals.wheel_speed) & np.isfinite(signals.carriage_rate)
    if not data.tabled:
        known[: TUNING.rig.slope_edge] = known[-TUNING.rig.slope_edge :] = False

    used = {c: known & still.get(c, driving) & np.isfinite(measured[c]) for c in data.channels}
    marks = (alone.astype(float), (turned & ~driving).astype(float))
    return GridRun(signals.name, np.asarray(motion.time), measured, used, along, *marks)


def covariates(
    signals: Signals, motion: Motion, wheel: Wheel, tabled: bool = False
) -> dict[str, Array]:
    """Of one run (n,) each, SI; `rolled` is the angle [rad] that the wheel has turned, either way,
    `sliding` the way [m] that its rim has slid over the soil.

    tabled: a table of steady states has no course of time, place and wheel angle: these are 0, so
        that the order of scatter that an importer drew is never taken for a trend or a ripple. A
        wheel in a steady state began long ago.
    """
    situation, angle = situation_of(motion, wheel), np.asarray(motion.wheel_angle)
    current = filled(signals.analogue.get("current", np.zeros(signals.time.size)))
    step = float(np.median(np.diff(signals.time)))
    ones = np.ones(signals.time.size)
    slid = np.abs(wheel.radius * np.asarray(motion.wheel_speed) - np.asarray(motion.carriage_speed))

    known = {
        "slip": np.asarray(situation.slip),
        "speed": np.asarray(wheel.radius * np.abs(motion.wheel_speed)),
        "load": np.asarray(motion.load) * ones,
        "wheel_angle": angle,
        "rolled": np.cumsum(np.abs(np.diff(angle, prepend=angle[0]))),
        "position": np.asarray(situation.position),
        "sliding": np.cumsum(slid) * step,
        "time": np.asarray(motion.time),
        "acceleration": np.asarray(situation.wheel_acceleration),
        "heat": np.cumsum(current**2) * step,
        "direction": np.asarray(situation.direction),
        "pass": motion.pass_number * ones,
        "constant": ones,
    }
    if tabled:
        known |= {name: 0.0 * ones for name in COURSE} | {"rolled": LONG_AGO * np.cumsum(ones)}
    return known


def torque_is_held(runs: Sequence[GridRun]) -> bool:
    """Whether a servo holds torque at rest: the current at rest differs from rest to rest, by more
    than its noise, so it tells nothing.
    """
    torque, rest = [run.measured["torque"] for run in runs], [_resting(run) for run in runs]
    rests = [values[at] for values, at in zip(torque, rest, strict=True) if at.any()]
    means = [float(values.mean()) for values in rests]
    noise = max((float(v.std() / np.sqrt(v.size)) for v in rests), default=0.0)

    used = [run.used["torque"] & ~at for run, at in zip(runs, rest, strict=True)]
    driven = np.concatenate([values[at] for values, at in zip(torque, used, strict=True)])
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
