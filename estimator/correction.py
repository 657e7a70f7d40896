"""What the closed forms (20)-(22) miss of Eqs. (1)-(10) and of the configured effects, as two smooth surfaces.

    T = T₂₂ · ratio(θ₁, i)          DP = DP₂₀ + W · pull(θ₁, i)

T₂₂ and DP₂₀ are the closed forms under the load W (σₘ eliminated through (21)). Both surfaces are computed once, at the
prior soil, by the original equations over a grid of θ₁ and i, and kept as polynomials of two variables. Without them
the linearised stresses bias c by a quarter or more (`gritd reproduce`, last table).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import reduce
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from estimator.balance import Contact, rim_forces
from estimator.effects import in_order
from estimator.effects.base import Effect
from estimator.forward import loaded, paper_contact
from estimator.situation import Reaction, Situation
from estimator.terramechanics import linear
from estimator.terramechanics.soil import Array, Soil, Wheel

DEGREE = 6  # of each variable: ratio within 2e-3 for slips above 5 %, T within 1e-4 r W everywhere (test_correction.py)
NODES = 20  # a variable
THETA_1 = (0.15, 1.4)  # [rad] the surfaces are fitted here and held constant outside
SLIP = (0.0, 1.0)
SOFTENING = 0.005  # slip enters as √(i + softening): where i is small it competes with θ₁², so the surface is steep
STEP = 0.1  # share of a prior standard deviation by which the soil is moved to see what follows
REFERENCE_SPEED = 0.02  # rim speed of the grid [m/s]


class At(NamedTuple):
    """A surface at one point, with its derivatives."""

    value: float
    by_theta_1: float  # [1/rad]
    by_slip: float


@dataclass(frozen=True)
class Surface:
    """A polynomial in x, y ∈ [−1, 1], coefficients of xᵖ yᵠ by rows p, highest powers first."""

    rows: tuple[tuple[float, ...], ...]

    def at(self, theta_1: float, slip: float) -> At:
        """Value and derivatives at θ₁ [rad] and i; beyond the fitted range those of its edge."""
        x, dx = _scaled(theta_1, *THETA_1)
        root, droot = _root(slip)
        y, dy = _scaled(root, *ROOTS)
        value = by_x = by_y = 0.0
        for row in self.rows:  # Horner's rule in y for each row, then in x
            inner = slope = 0.0
            for coefficient in row:
                slope = slope * y + inner
                inner = inner * y + coefficient
            by_x = by_x * x + value
            value = value * x + inner
            by_y = by_y * x + slope
        return At(value, by_x * dx, by_y * dy * droot)


@dataclass(frozen=True)
class Correction:
    """Surfaces of T₂₂'s factor and of the pull missing per load, and how far the soil prior leaves them open."""

    torque: Surface  # T / T₂₂ [-]
    pull: Surface  # (DP − DP₂₀) / W [-]
    torque_sigma: float  # relative standard deviation of the factor under the prior [-]
    pull_sigma: float  # standard deviation of the pull per load [-]


def correction(
    wheel: Wheel,
    soil: Soil,
    effects: Sequence[Effect] = (),
    sigma: Soil | None = None,
    situation: Situation | None = None,
) -> Correction:
    """The correction at a soil with the effects of its stages soil, contact and wheel.

    sigma:     standard deviations of the soil's fields; without them the correction is taken as exact.
    situation: speed, pass, time and place at which effects that depend on them are taken.
    """
    theta_1, slip = _grid()
    torque, pull, weight = _missing(wheel, soil, effects, theta_1, slip, situation)
    spread = np.zeros((2, theta_1.size))
    for moved in _neighbours(soil, sigma):
        other = _missing(wheel, moved, effects, theta_1, slip, situation)
        spread += ((other[0] - torque) / STEP) ** 2, ((other[1] - pull) / STEP) ** 2
    torque_sigma, pull_sigma = np.sqrt(np.average(spread, axis=1, weights=weight))
    return Correction(
        torque=_fit(theta_1, slip, torque, weight),
        pull=_fit(theta_1, slip, pull, np.ones_like(weight)),
        torque_sigma=float(torque_sigma),
        pull_sigma=float(pull_sigma),
    )


def _missing(
    wheel: Wheel,
    soil: Soil,
    effects: Sequence[Effect],
    theta_1: Array,
    slip: Array,
    situation: Situation | None,
) -> tuple[Array, Array, Array]:
    """T/T₂₂, (DP − DP₂₀)/W and T/(r W) of the original equations with effects, at each point of the grid."""
    at, acting = _situation(wheel, slip, situation), in_order(effects)
    true = reduce(lambda soil, e: e.soil(soil, at), acting, soil)
    at = replace(at, cohesion=true.cohesion, tan_phi=true.tan_phi, shear_modulus=true.shear_modulus)
    law = reduce(lambda law, e: e.contact(law, at), acting, paper_contact(wheel, at))
    forces = rim_forces(wheel, Contact(true, law, slip, 0.0), theta_1, order=16)
    at = loaded(at, wheel, theta_1, forces)
    felt = Reaction(at.drawbar_pull, at.carried, at.torque, at.sinkage)
    felt = reduce(lambda felt, e: e.wheel(felt, at), acting, felt)
    closed = linear.predict_batch(wheel, soil.cohesion, soil.tan_phi, soil.shear_modulus, theta_1, slip, felt.load)
    return (
        np.asarray(felt.torque / closed.torque),
        np.asarray((felt.drawbar_pull - closed.drawbar_pull) / felt.load),
        np.asarray(felt.torque / (wheel.radius * felt.load)),
    )


def _situation(wheel: Wheel, slip: Array, situation: Situation | None) -> Situation:
    speed = REFERENCE_SPEED / wheel.radius
    usual = Situation(
        time=0.0,
        wheel_angle=0.0,
        wheel_speed=speed,
        wheel_acceleration=0.0,
        carriage_speed=0.0,
        position=0.0,
        pass_number=1.0,
        radius=wheel.radius,
        width=wheel.width,
        slip=slip,
        direction=1.0,
        load=0.0,
    )
    return usual if situation is None else replace(situation, slip=slip, direction=1.0)


def _neighbours(soil: Soil, sigma: Soil | None) -> list[Soil]:
    """The soil with each uncertain field moved by STEP standard deviations."""
    if sigma is None:
        return []
    moves = {f.name: STEP * getattr(sigma, f.name) for f in fields(soil)}
    return [replace(soil, **{name: getattr(soil, name) + move}) for name, move in moves.items() if move > 0.0]


# ---- surfaces ------------------------------------------------------------------------------------------------------


def _root(slip: float) -> tuple[float, float]:
    """√(i + softening) inside the fitted range, and its derivative."""
    inside = min(max(slip, SLIP[0]), SLIP[1])
    root = sqrt(inside + SOFTENING)
    return root, 0.5 / root if inside == slip else 0.0


ROOTS = (_root(SLIP[0])[0], _root(SLIP[1])[0])


def _scaled(value: float, low: float, high: float) -> tuple[float, float]:
    """The value on [−1, 1] with its derivative; held at the edges."""
    slope = 2.0 / (high - low)
    scaled = (value - low) * slope - 1.0
    return (scaled, slope) if -1.0 <= scaled <= 1.0 else (min(max(scaled, -1.0), 1.0), 0.0)


def _grid() -> tuple[Array, Array]:
    """θ₁ and i at the Chebyshev nodes of both variables, each (NODES²,)."""
    nodes = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
    x, y = (axis.ravel() for axis in np.meshgrid(nodes, nodes, indexing="ij"))
    root = ROOTS[0] + 0.5 * (y + 1.0) * (ROOTS[1] - ROOTS[0])
    return THETA_1[0] + 0.5 * (x + 1.0) * (THETA_1[1] - THETA_1[0]), np.clip(root**2 - SOFTENING, *SLIP)


def _fit(theta_1: Array, slip: Array, value: Array, weight: Array) -> Surface:
    """The polynomial nearest to the values, by weighted least squares."""
    x = 2.0 * (theta_1 - THETA_1[0]) / (THETA_1[1] - THETA_1[0]) - 1.0
    y = 2.0 * (np.sqrt(slip + SOFTENING) - ROOTS[0]) / (ROOTS[1] - ROOTS[0]) - 1.0
    basis = chebyshev.chebvander2d(x, y, [DEGREE, DEGREE])
    found = np.linalg.lstsq(basis * weight[:, None], value * weight, rcond=None)[0].reshape(DEGREE + 1, DEGREE + 1)
    to_powers = np.array([np.pad(chebyshev.cheb2poly(unit), (0, DEGREE - p)) for p, unit in _units()])
    powers = to_powers.T @ found @ to_powers
    return Surface(tuple(tuple(float(c) for c in row[::-1]) for row in powers[::-1]))


def _units() -> list[tuple[int, Array]]:
    """Each Chebyshev polynomial alone, with its degree."""
    return [(p, np.eye(DEGREE + 1)[p][: p + 1]) for p in range(DEGREE + 1)]
