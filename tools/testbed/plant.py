"""What the simulated testbed is asked to do, the soil under it, and the two plants that may answer.

`original` solves Eqs. (1)-(10) by the forward model; `linear` obeys the closed forms (20)-(22)
exactly, which is what the filter takes for true.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from gritd.estimator.config.effects import configured
from gritd.estimator.config.settings import Settings, Uncertain
from gritd.estimator.model.forward import Response
from gritd.estimator.stages.situation import Motion, Sensed, situation_of
from gritd.estimator.terramechanics import linear
from gritd.estimator.terramechanics.soil import Array, Soil
from gritd.tools.testbed.schedule import Schedule, Segment
from gritd.tools.testbed.sensors import readings
from gritd.tools.testbed.simulation import SimulatedRun, answered, soil_of

PlantKind = Literal["original", "linear"]

RAMP = 0.5  # [s] between conditions
REST = 1.5  # [s] of standstill at the start
# [s] of standstill after the end, so that the wires are not silent before the daemon is stopped
TAIL = 2.0
USUAL = 3.9  # [s] a condition, its ramp included
SHORTEST = 1.0  # [s]
LOADS = (30.0, 65.0, 105.0)  # [N]
SLIPS = (0.2, 0.6, 0.05, 0.4, 0.1)  # in this order, so that k shows early
SPEEDS = (0.022, 0.028, 0.025)  # of the rim [m/s], one a load
DEEPEST = 1.5  # [rad] end of the bracket for θ₁


def schedule(seconds: float) -> Schedule:
    """Standstill, then three loads with as many slips each as there is time for; to rest after
    `seconds`.
    """
    each = (seconds - REST) / len(LOADS)
    count = max(1, min(len(SLIPS), max(round(each / USUAL), min(2, int(each / SHORTEST)))))

    driven = [
        Segment(each / count, load, slip, speed)
        for load, speed in zip(LOADS, SPEEDS, strict=True)
        for slip in SLIPS[:count]
    ]
    driven[-1] = replace(driven[-1], duration=each / count + RAMP)

    first, last = Segment(REST, LOADS[0], SLIPS[0], 0.0), Segment(TAIL, LOADS[-1], SLIPS[0], 0.0)
    return Schedule((first, *driven, last), RAMP)


def drawn_soil(settings: Settings, rng: np.random.Generator) -> Soil:
    """A soil about one sigma off the configured one, signs drawn: c and tan φ 0.8 to 1.2 σ, k 10 to
    15 %.
    """

    def away(known: Uncertain, low: float, high: float) -> float:
        return known.value + float(rng.choice((-1.0, 1.0)) * rng.uniform(low, high))

    c, tan_phi, k = settings.soil.cohesion, settings.soil.tan_phi, settings.soil.shear_modulus
    return soil_of(
        settings,
        {
            "cohesion": max(away(c, 0.8 * c.sigma, 1.2 * c.sigma), 0.2 * c.value),
            "tan_phi": away(tan_phi, 0.8 * tan_phi.sigma, 1.2 * tan_phi.sigma),
            "shear_modulus": away(k, 0.10 * k.value, 0.15 * k.value),
        },
    )


def drive(
    plant: PlantKind, settings: Settings, soil: Soil, motion: Motion, seed: int
) -> SimulatedRun:
    """What the wheel does on this soil, and what the sensors send."""
    response = respond(plant, settings, soil, motion)
    return SimulatedRun(
        motion, response, readings(settings, motion, response, np.random.default_rng(seed))
    )


def respond(plant: PlantKind, settings: Settings, soil: Soil, motion: Motion) -> Response:
    """What the wheel does on this soil."""
    if plant == "linear":
        return linear_response(settings, soil, motion)
    return answered(settings, soil, motion, configured(settings.effects))


def linear_response(settings: Settings, soil: Soil, motion: Motion) -> Response:
    """σₘ by Eq. (3) at θₘ; θ₁ where Eq. (21) carries the load; DP and T by Eqs. (20) and (22).
    Arrays (n,).
    """
    wheel, situation = settings.wheel, situation_of(motion, settings.wheel)
    slip, direction = np.asarray(situation.slip), np.asarray(situation.direction)
    known = (wheel, soil.cohesion, soil.tan_phi, soil.shear_modulus)

    def forces(theta_1: Array) -> linear.LinearForces:
        theta_m = (wheel.c1 + wheel.c2 * slip) * theta_1
        sigma_m = (
            soil.modulus * (wheel.radius * (np.cos(theta_m) - np.cos(theta_1))) ** soil.exponent
        )
        return linear.forces(*known, theta_1, slip, sigma_m, linear.ARRAYS)

    theta_1 = _rising_to_zero(
        lambda angle: np.asarray(forces(angle).load - motion.load), slip.shape
    )
    at = forces(theta_1)
    torque, pull, load = at.torque * direction, at.drawbar_pull * direction, np.asarray(motion.load)
    sinkage, current = (
        wheel.radius * (1.0 - np.cos(theta_1)),
        torque / settings.drive.torque_constant.value,
    )
    return Response(
        slip=slip,
        theta_1=theta_1,
        overloaded=np.greater(theta_1, 0.999 * DEEPEST),
        sinkage=sinkage,
        drawbar_pull=pull,
        load=load,
        torque=torque,
        motor_torque=torque,
        current=current,
        sensed=Sensed(sinkage, current, pull, load, torque),
    )


def _rising_to_zero(function: Callable[[Array], Array], shape: tuple[int, ...]) -> Array:
    """The θ₁ at which an increasing function is 0, for all samples at once, by bisection."""
    low, high = np.full(shape, 1e-3), np.full(shape, DEEPEST)
    for _ in range(50):
        middle = 0.5 * (low + high)
        above = function(middle) > 0.0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    root: Array = 0.5 * (low + high)
    return root
