"""The on-line form of `stress_linearisation` and of the contact effects: what the true stresses add
to A₁ … C₃.

Eqs. (20)-(22) are linear in c, σₘ and σₘ tan φ, with eight integrals A₁ … C₃ over the contact as
coefficients (see terramechanics/linear.py). The original stresses (3), (4), (7) obey the same three
equations with eight other integrals, whatever c, tan φ and W are. What separates the two models is
therefore eight functions of θ₁ and i for a soil of given k and n. They are tabulated once, as
Chebyshev polynomials, together with their derivatives with respect to ln k and n: the filter stays
exact in c, tan φ and W, and is first-order in ln k and n.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import acos, log, sin
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from gritd.estimator.effects import in_order
from gritd.estimator.effects.base import Effect
from gritd.estimator.model.forward import paper_contact
from gritd.estimator.stages.situation import Situation
from gritd.estimator.terramechanics import linear, original
from gritd.estimator.terramechanics.integrals import Integrals, integrals
from gritd.estimator.terramechanics.linear import Shift
from gritd.estimator.terramechanics.soil import Array, Soil, Wheel

THETA_1 = (0.05, 1.45)  # [rad] range of the table; outside it the edge is used
SLIP = (-0.1, 1.0)
NODES = (20, 20)  # of θ₁ and i
DEGREE = (13, 13)
STEP = 0.02  # of ln k and n for the derivatives
# evaluated points: all stretches of the filter's memory, and the windows since they were last used
REMEMBERED = 256
ORDERS = tuple(np.arange(degree + 1) for degree in DEGREE)  # of the polynomials in θ₁ and i
INSIDE = 1.0 - 1e-12  # as near to an edge as sin t allows
ORDER = 24  # quadrature nodes in each zone
PEAK = 0.999  # of θₘ/θ₁: at the entry itself σₘ says nothing of the modulus
INTEGRALS = len(Integrals._fields)
PLAIN, BY_LN_K, BY_N = (slice(part * INTEGRALS, (part + 1) * INTEGRALS) for part in range(3))


class Point(NamedTuple):
    """The tables at one θ₁ and i: each (3, 8), the integrals' values and derivatives with respect
    to θ₁ and i.
    """

    plain: Array  # the shift at the soil's k and n
    by_ln_k: Array
    by_n: Array
    ln_k: Integrals  # first row of by_ln_k


class IntegralShift:
    """The shift of A₁ … C₃ for one wheel, soil and set of effects.

    share: 1 replaces the triangular stresses by the true ones, 0 keeps them; the effects' own part
    is always whole. Soil effects count where they depend on slip alone (the exponent); what they do
    to c, tan φ and k is the caller's.
    """

    def __init__(
        self, wheel: Wheel, soil: Soil, effects: tuple[Effect, ...] = (), share: float = 1.0
    ) -> None:
        self._ln_k = log(float(soil.shear_modulus))
        theta_1, slip = np.meshgrid(
            _nodes(THETA_1, NODES[0]), _nodes(SLIP, NODES[1]), indexing="ij"
        )

        def shift(ln_k: float, n: float) -> Array:
            varied = replace(soil, shear_modulus=float(np.exp(ln_k)), exponent=n)
            return _shift(wheel, varied, in_order(effects), share, theta_1, slip)

        k, n = self._ln_k, float(soil.exponent)
        by_ln_k = (shift(k + STEP, n) - shift(k - STEP, n)) / (2.0 * STEP)
        by_n = (shift(k, n + STEP) - shift(k, n - STEP)) / (2.0 * STEP)
        coefficients = _fitted(np.concatenate((shift(k, n), by_ln_k, by_n)))
        self._coefficients = coefficients.transpose(1, 0, 2).reshape(DEGREE[0] + 1, -1).copy()
        self._table = lru_cache(REMEMBERED)(self._tabulated)  # a window is looked at more than once

    def at(self, k: float, theta_1: float, slip: float, exponent_error: float = 0.0) -> Shift:
        """At a shear modulus k [m], θ₁ [rad] and slip i; exponent_error is added to the soil's
        exponent n.
        """
        plain, by_ln_k, by_n, ln_k = self._table(theta_1, slip)
        shift = plain + (log(k) - self._ln_k) * by_ln_k
        if exponent_error:
            shift = shift + exponent_error * by_n
        value, by_theta_1, by_slip = map(Integrals._make, shift.tolist())
        return Shift(value, by_theta_1, by_slip, ln_k)

    def _tabulated(self, theta_1: float, slip: float) -> Point:
        """The tables at one point."""
        u, du = _unit(theta_1, THETA_1)
        v, dv = _unit(slip, SLIP)
        rows, columns = _polynomials(u, ORDERS[0], du), _polynomials(v, ORDERS[1], dv)
        # (2 for θ₁ · quantities, powers of i)
        along_slip = (rows @ self._coefficients).reshape(-1, DEGREE[1] + 1)
        by_value, by_slip = (along_slip @ columns.T).T.reshape(2, 2, -1)
        tables = np.array((by_value[0], by_value[1], by_slip[0]))
        by_ln_k = tables[:, BY_LN_K]
        return Point(tables[:, PLAIN], by_ln_k, tables[:, BY_N], Integrals(*by_ln_k[0].tolist()))


def true_integrals(
    wheel: Wheel, soil: Soil, effects: tuple[Effect, ...], theta_1: Array, slip: Array
) -> Integrals:
    """A₁ … C₃ over θ₁ of the original stresses with the contact effects; θ₁, i and the results have
    one shape.

    Forces are linear in c and σₘ, so three evaluations with unit soils pick the integrals out.
    """
    situation = _steady(wheel, soil, theta_1, slip)
    for effect in effects:
        soil = effect.soil(soil, situation)
    law = paper_contact(wheel, situation)
    for effect in effects:
        law = effect.contact(law, situation)
    theta_m = np.clip(law.theta_m_ratio, 0.0, PEAK) * theta_1
    depth = (wheel.radius * (np.cos(theta_m) - np.cos(theta_1))) ** soil.exponent

    def forces(c: float, sigma_m: float, tan_phi: float) -> original.Forces:
        return original.forces(
            wheel,
            Soil(c, tan_phi, soil.shear_modulus, soil.exponent, sigma_m / depth),
            theta_1,
            slip,
            theta_m=theta_m,
            theta_2=-law.theta_2_ratio * theta_1,
            mobilisation=law.mobilisation,
            side_slip=law.side_slip,
            order=ORDER,
        )

    cohesive, bearing, rubbing = forces(1.0, 0.0, 0.0), forces(0.0, 1.0, 0.0), forces(0.0, 1.0, 1.0)
    area = wheel.radius * wheel.width * theta_1
    return Integrals(
        a1=cohesive.torque / (wheel.radius * area),
        a2=rubbing.torque / (wheel.radius * area),
        b1=bearing.load / area,
        b2=cohesive.load / area,
        b3=(rubbing.load - bearing.load) / area,
        c1=cohesive.drawbar_pull / area,
        c2=(rubbing.drawbar_pull + rubbing.resistance) / area,
        c3=bearing.resistance / area,
    )


def _shift(
    wheel: Wheel, soil: Soil, effects: tuple[Effect, ...], share: float, theta_1: Array, slip: Array
) -> Array:
    """(8, nodes, nodes): the effects' part, and the share of what the triangles miss."""
    paper = np.array(true_integrals(wheel, soil, (), theta_1, slip))
    exponent = linear.shear_exponent(wheel, soil.shear_modulus, theta_1, slip, linear.ARRAYS)
    ratio = np.clip(wheel.c1 + wheel.c2 * slip, 0.0, 1.0)
    closed = np.array(integrals(theta_1, ratio, exponent.f, linear.ARRAYS))
    shift: Array = share * (paper - closed)
    if effects:
        shift = shift + np.array(true_integrals(wheel, soil, effects, theta_1, slip)) - paper
    return shift


def _steady(wheel: Wheel, soil: Soil, theta_1: Array, slip: Array) -> Situation:
    """A wheel in steady forward motion on fresh soil, at no particular place or time."""
    return Situation(
        time=0.0,
        wheel_angle=0.0,
        wheel_speed=0.0,
        wheel_acceleration=0.0,
        carriage_speed=0.0,
        position=0.0,
        pass_number=1.0,
        radius=wheel.radius,
        width=wheel.width,
        slip=slip,
        direction=1.0,
        load=0.0,
        cohesion=soil.cohesion,
        tan_phi=soil.tan_phi,
        shear_modulus=soil.shear_modulus,
        theta_1=theta_1,
    )


def _fitted(values: Array) -> Array:
    """Chebyshev coefficients (quantities, DEGREE[0] + 1, DEGREE[1] + 1) of values at the nodes, by
    least squares.
    """
    rows = chebyshev.chebvander(_nodes((-1.0, 1.0), NODES[0]), DEGREE[0])
    columns = chebyshev.chebvander(_nodes((-1.0, 1.0), NODES[1]), DEGREE[1])
    fitted: Array = np.einsum(
        "ai,qij,bj->qab", np.linalg.pinv(rows), values, np.linalg.pinv(columns)
    )
    return fitted


def _nodes(span: tuple[float, float], count: int) -> Array:
    """Chebyshev nodes of an interval."""
    low, high = span
    unit: Array = np.cos(np.pi * (np.arange(count) + 0.5) / count)
    return 0.5 * (low + high) + 0.5 * (high - low) * unit


def _unit(x: float, span: tuple[float, float]) -> tuple[float, float]:
    """x mapped to [−1, 1], and the slope of the map; held constant outside the span."""
    low, high = span
    slope = 2.0 / (high - low)
    if low <= x <= high:
        return (x - low) * slope - 1.0, slope
    return (-1.0 if x < low else 1.0), 0.0


def _polynomials(x: float, orders: NDArray[np.int_], slope: float) -> Array:
    """(2, m): Tₙ at x = cos t for the orders n (m,), and their derivatives n sin(nt)/sin t times
    slope.
    """
    angle = acos(min(max(x, -INSIDE), INSIDE))
    phase = orders * angle
    return np.array((np.cos(phase), slope / sin(angle) * orders * np.sin(phase)))
