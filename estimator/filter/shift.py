"""The on-line form of `stress_linearisation` and of the contact effects: what the true stresses add
to A₁ … C₃.

Eqs. (20)-(22) are linear in c, σₘ and σₘ tan φ, with eight integrals A₁ … C₃ over the contact as
coefficients (see terramechanics/linear.py). The original stresses (3), (4), (7) obey the same three
equations with eight other integrals, whatever c, tan φ and W are. What separates the two models is
therefore eight functions of θ₁ and i for a soil of given k and n. They are tabulated once, as
Chebyshev polynomials, together with their derivatives with respect to ln k and n: the filter stays
exact in c, tan φ and W, and is first-order in ln k and n.

Polynomials are summed in a stated order, by numpy along axes that it does not reorder, and never by
BLAS, whose order depends on the processor: compiled/closed.c gives the same bits.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from math import cos, log, pi
from typing import NamedTuple

import numpy as np

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
QUANTUM = 2.0**-30  # of a coefficient; the largest is about 0.2, and the table is good to 1e-4
# evaluated points: all stretches of the filter's memory, and the windows since they were last used
REMEMBERED = 256
ORDER = 24  # quadrature nodes in each zone
PEAK = 0.999  # of θₘ/θ₁: at the entry itself σₘ says nothing of the modulus
INTEGRALS = len(Integrals._fields)
PLAIN, BY_LN_K, BY_N = (slice(part * INTEGRALS, (part + 1) * INTEGRALS) for part in range(3))

Vector = tuple[float, ...]


class Point(NamedTuple):
    """The tables at one θ₁ and i."""

    # (3, q): values and derivatives with respect to θ₁ and i, of PLAIN, BY_LN_K and where it is
    # asked for BY_N, the shift at the soil's k and n and its derivatives
    tables: Array
    ln_k: Integrals  # values of BY_LN_K


class IntegralShift:
    """The shift of A₁ … C₃ for one wheel, soil and set of effects.

    share: 1 replaces the triangular stresses by the true ones, 0 keeps them; the effects' own part
    is always whole. Soil effects count where they depend on slip alone (the exponent); what they do
    to c, tan φ and k is the caller's.
    """

    def __init__(
        self, wheel: Wheel, soil: Soil, effects: tuple[Effect, ...] = (), share: float = 1.0
    ) -> None:
        self.ln_k = log(float(soil.shear_modulus))
        theta_1, slip = np.meshgrid(
            _nodes(THETA_1, NODES[0]), _nodes(SLIP, NODES[1]), indexing="ij"
        )

        def shift(ln_k: float, n: float) -> Array:
            varied = replace(soil, shear_modulus=float(np.exp(ln_k)), exponent=n)
            return _shift(wheel, varied, in_order(effects), share, theta_1, slip)

        k, n = self.ln_k, float(soil.exponent)
        by_ln_k = (shift(k + STEP, n) - shift(k - STEP, n)) / (2.0 * STEP)
        by_n = (shift(k, n + STEP) - shift(k, n - STEP)) / (2.0 * STEP)
        coefficients = _fitted(np.concatenate((shift(k, n), by_ln_k, by_n)))
        # (DEGREE[0] + 1, DEGREE[1] + 1, 24)
        self.coefficients: Array = np.ascontiguousarray(coefficients.transpose(1, 2, 0))
        self._without_n = self.coefficients[..., : BY_N.start].copy()
        self._table = lru_cache(REMEMBERED)(self._tabulated)  # a window is looked at more than once

    def at(self, k: float, theta_1: float, slip: float, exponent_error: float = 0.0) -> Shift:
        """At a shear modulus k [m], θ₁ [rad] and slip i; exponent_error is added to the soil's
        exponent n.
        """
        tables, ln_k = self._table(theta_1, slip, exponent_error != 0.0)
        shift = tables[:, PLAIN] + (log(k) - self.ln_k) * tables[:, BY_LN_K]
        if exponent_error:
            shift = shift + exponent_error * tables[:, BY_N]
        value, by_theta_1, by_slip = map(Integrals._make, shift.tolist())
        return Shift(value, by_theta_1, by_slip, ln_k)

    def _tabulated(self, theta_1: float, slip: float, with_n: bool) -> Point:
        """The tables at one point."""
        coefficients = self.coefficients if with_n else self._without_n
        rows = np.array(_polynomials(*_unit(theta_1, THETA_1), DEGREE[0]))
        columns = np.array(_polynomials(*_unit(slip, SLIP), DEGREE[1]))

        # sums over an axis that is not the last are made term by term; (2 for θ₁, powers of i, q)
        along = np.add.reduce(rows[:, :, None, None] * coefficients, axis=1)
        value, by_slip = np.add.reduce(columns[:, :, None] * along[0], axis=1)
        by_theta_1 = np.add.reduce(columns[0][:, None] * along[1], axis=0)
        return Point(np.array((value, by_theta_1, by_slip)), Integrals(*value[BY_LN_K].tolist()))


def true_integrals(
    wheel: Wheel, soil: Soil, effects: tuple[Effect, ...], theta_1: Array, slip: Array
) -> Integrals:
    """A₁ … C₃ over θ₁ of the original stresses with the contact effects; θ₁, i and the results have
    one shape (n,).

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
    """Chebyshev coefficients (quantities, DEGREE[0] + 1, DEGREE[1] + 1) of values (quantities,
    nodes, nodes) at the nodes, by least squares.

    The polynomials are orthogonal on the nodes, so a coefficient is a weighted sum of the values.
    It is rounded to QUANTUM: sine and exponential differ in the last digit between processors, and
    what is rounded does not.
    """
    rows, columns = _weights(NODES[0], DEGREE[0]), _weights(NODES[1], DEGREE[1])

    # sums over an axis that is not the last are made term by term
    along = np.add.reduce(rows[:, :, None] * values[:, None], axis=2)
    turned = np.ascontiguousarray(along.transpose(0, 2, 1))
    fitted = np.add.reduce(columns.T[:, :, None] * turned[:, :, None], axis=1)

    # − 0 becomes 0
    rounded: Array = np.round(fitted.transpose(0, 2, 1) / QUANTUM) * QUANTUM + 0.0
    return rounded


def _weights(nodes: int, degree: int) -> Array:
    """(degree + 1, nodes): weight of the value at each node in each coefficient."""
    at = _nodes((-1.0, 1.0), nodes).tolist()
    polynomials = np.array([_polynomials(x, 1.0, degree)[0] for x in at]).T
    polynomials[0] /= 2.0
    return polynomials * (2.0 / nodes)


def _nodes(span: tuple[float, float], count: int) -> Array:
    """Chebyshev nodes of an interval."""
    low, high = span
    unit = np.array([cos(pi * (number + 0.5) / count) for number in range(count)])
    return 0.5 * (low + high) + 0.5 * (high - low) * unit


def _unit(x: float, span: tuple[float, float]) -> tuple[float, float]:
    """x mapped to [−1, 1], and the slope of the map; held constant outside the span."""
    low, high = span
    slope = 2.0 / (high - low)
    if low <= x <= high:
        return (x - low) * slope - 1.0, slope
    return (-1.0 if x < low else 1.0), 0.0


def _polynomials(x: float, slope: float, degree: int) -> tuple[Vector, Vector]:
    """T₀ … Tₙ at x, and their derivatives m Uₘ₋₁ times slope, by the recurrence
    p₊ = 2x p − p₋ of both kinds.
    """
    first, second = [1.0, x], [0.0, 1.0]
    for _ in range(degree - 1):
        first.append(2.0 * x * first[-1] - first[-2])
        second.append(2.0 * x * second[-1] - second[-2])
    return tuple(first), tuple([slope * (m * u) for m, u in enumerate(second)])
