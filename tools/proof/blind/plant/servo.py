"""Wheel and carriage under their speed controllers: what they really do when the soil pulls at
them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.tools.proof.blind.plant.quadrature import Array


@dataclass(frozen=True)
class Servo:
    """A PI speed loop around an inertia; gain in force per speed, SI of its axis (N·m·s/rad or
    N·s/m).
    """

    inertia: float  # [kg·m²] or [kg]
    gain: float
    reset: float  # [s] integral time


def follow(servo: Servo, wanted: Array, against: Array, step: float, substeps: int = 2) -> Array:
    """Speed (n,) of an axis commanded to run at `wanted` (n,) while the force or torque `against`
    (n,) holds it back.

    Fixed steps, implicit in the speed: m u̇ = P (u* − u) + (P/T)∫(u* − u)dt − F. Starts at rest in
        balance.
    """
    h = step / substeps
    integral_gain = servo.gain / servo.reset
    divisor = servo.inertia / h + servo.gain + integral_gain * h
    speed, integral = float(wanted[0]), float(against[0]) / integral_gain

    speeds = []
    for goal, force in zip(wanted.tolist(), against.tolist(), strict=True):
        for _ in range(substeps):
            drive = servo.gain * goal + integral_gain * (integral + h * goal) - force
            speed = (servo.inertia / h * speed + drive) / divisor
            integral += h * (goal - speed)
        speeds.append(speed)

    return np.array(speeds)


def summed(rate: Array, step: float) -> Array:
    """Integral of a rate (n,) from 0 by trapezoids (n,), in its unit times that of the step."""
    return np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * step)))
