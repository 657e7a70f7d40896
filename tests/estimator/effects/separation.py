"""Which experiment tells two effects apart: a campaign with it against the same campaign without
it.

What an effect changes is fitted by the soil, within its prior, and by the other effect. What is
left over, in standard deviations, is what a diagnosis has to tell the two by. Experiments that need
another instrument or another wheel are not simulated.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from gritd.estimator.effects import EFFECTS
from gritd.estimator.effects.base import Effect
from gritd.estimator.model.forward import simulate_arrays
from gritd.estimator.stages.situation import Motion
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.tools.testbed.fingerprints import NOISE, SOIL, TORQUE_CONSTANT, WHEEL, channels, typical
from gritd.tools.testbed.schedule import Schedule, Segment, motion_of

PLAIN = (
    "load_step",
    "slip_step",
    "speed_step",
    "second_pass",
)  # in every campaign, unless they are what is judged
EXTRA = ("standstill", "lifted_spin", "reversal", "shifted_start", "long_run", "wrench")
SIMULATED = frozenset(PLAIN + EXTRA)

RATE, HOLD, RAMP = 10.0, 4.0, 0.5  # [Hz, s, s]
LOAD, SLIP, SPEED = 65.0, 0.3, 0.018  # [N], [-], rim [m/s]
LONG = 900.0  # [s]
CORRELATED = 1.0  # [s] samples closer than this count as one
PRIOR = {
    "cohesion": 300.0,
    "tan_phi": 0.06,
    "shear_modulus": 2.5e-3,
    "exponent": 0.05,
    "modulus": 7.7e4,
}  # sigma, SI
STEP = 0.1  # share of sigma for a derivative
LOOSE = 10.0  # prior sigmas that a rival's strength may take

Have = tuple[str, ...]


def separation(effect: str, rival: str, experiment: str) -> tuple[float, float]:
    """What is left of the effect when soil and rival have fitted it [σ]: without and with the
    experiment.
    """
    without = tuple(name for name in PLAIN if name != experiment)
    return left_over(effect, rival, without), left_over(effect, rival, (*without, experiment))


def left_over(effect: str, rival: str, have: Have) -> float:
    """Root of the smallest misfit and strain with which soil and rival imitate the effect at its
    typical strength.
    """
    soil, other = _soil_columns(have), _strength_columns(rival, have)
    columns = np.stack((*soil, *other), axis=1)
    strain = np.diag([1.0] * len(soil) + [LOOSE**-2] * len(other))
    change = _seen(have, typical(EFFECTS[effect])) - _seen(have)
    fitted = np.linalg.solve(columns.T @ columns + strain, columns.T @ change)
    return float(np.sqrt(np.sum((change - columns @ fitted) ** 2) + fitted @ strain @ fitted))


@cache
def _soil_columns(have: Have) -> list[Array]:
    """Change of all channels per prior sigma of each soil parameter."""
    moved = (
        replace(SOIL, **{name: getattr(SOIL, name) + STEP * sigma}) for name, sigma in PRIOR.items()
    )
    return [(_channels(have, soil, ()) - _seen(have)) / STEP for soil in moved]


@cache
def _strength_columns(name: str, have: Have) -> list[Array]:
    """Change of all channels per typical size of each strength, at the off value."""
    effect = EFFECTS[name]
    strengths = [p for p in effect.parameters() if p.role == "strength"]
    return [
        (_seen(have, effect(**{p.name: p.off + STEP * p.sigma})) - _seen(have)) / STEP
        for p in strengths
    ]


@cache
def _seen(have: Have, *effects: Effect) -> Array:
    return _channels(have, SOIL, effects)


def _channels(have: Have, soil: Soil, effects: tuple[Effect, ...]) -> Array:
    """All channels of all runs, over noise and weighed by the time each sample stands for."""
    columns = []
    for motion in runs(have):
        response = simulate_arrays(WHEEL, soil, motion, effects, torque_constant=TORQUE_CONSTANT)
        weight = np.sqrt(np.gradient(np.asarray(motion.time)) / CORRELATED)
        columns += [weight * values / NOISE[name] for name, values in channels(response).items()]
        if "wrench" in have:
            columns.append(weight * response.sensed.torque / NOISE["torque"])
    return np.concatenate(columns)


@cache
def runs(have: Have) -> tuple[Motion, ...]:
    """The campaign: one run with the steps asked for, and more runs for passes, places and time."""
    schedule = Schedule(_segments(have), RAMP)
    first = motion_of(schedule, WHEEL.radius, RATE)
    lasts = schedule.duration

    more = [(p, 0.0) for p in (2.0, 3.0) if "second_pass" in have] + [
        (1.0, x) for x in (0.25, 0.5) if "shifted_start" in have
    ]
    later = [
        replace(first, time=first.time + lasts * (i + 1), pass_number=number, start_position=start)
        for i, (number, start) in enumerate(more)
    ]

    long = [motion_of(Schedule((Segment(LONG, LOAD, SLIP, SPEED),), RAMP), WHEEL.radius, 1.0)]
    return first, *later, *(long if "long_run" in have else [])


def _segments(have: Have) -> tuple[Segment, ...]:
    """All combinations of the steps asked for in a drawn order, then rest, air and the way back."""
    loads = (LOAD, 35.0, 95.0) if "load_step" in have else (LOAD,)
    slips = (SLIP, 0.05, 0.6) if "slip_step" in have else (SLIP,)
    speeds = (SPEED, 0.006, 0.036) if "speed_step" in have else (SPEED,)

    driven = [(load, slip, speed) for load in loads for slip in slips for speed in speeds]
    drawn = [driven[i] for i in np.random.default_rng(1).permutation(len(driven))]

    if "standstill" in have:
        drawn += [(LOAD, SLIP, 0.0)] * 2
    if "lifted_spin" in have:
        drawn += [(0.0, SLIP, speed) for speed in (0.006, 0.018, 0.036, -0.018)]
    if "reversal" in have:
        drawn += [(load, slip, -SPEED) for load in loads for slip in slips]

    return tuple(Segment(HOLD, *condition) for condition in drawn)
