"""The on-line form of `stress_linearisation` and of the contact effects: what the true stresses add
to A₁ … C₃.

Eqs. (20)-(22) are linear in c, σₘ and σₘ tan φ, with eight integrals A₁ … C₃ over the contact as
coefficients (see terramechanics/linear.py). The original stresses (3), (4), (7) obey the same three
equations with eight other integrals, whatever c, tan φ and W are. What separates the two models is
therefore eight functions of θ₁ and i for a soil of given k and n and a stress peak at given c₁ and
c₂. They are tabulated once, as Chebyshev polynomials, with what changes when ln k, n and the place
λ = θₘ/θ₁ of the peak do:

    Δ = Δ₀ + κ (Δ₁ + κ (Δ₂ + κ (Δ₃ + κ (Δ₄ + κ Δ₅)))) + ν (Δ₆ + κ (Δ₇ + κ Δ₈) + ν Δ₉)
        + μ (Δ₁₀ + κ (Δ₁₁ + κ Δ₁₂) + μ Δ₁₃ + ν Δ₁₄)

κ, ν, μ: ln k, n and λ less those of the prior. The filter stays exact in c, tan φ and W, and the
triangles in k and λ too.

Polynomials are summed in a stated order, by numpy along axes that it does not reorder, and never by
BLAS, whose order depends on the processor: compiled/closed.c gives the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from math import cos, log, pi

import numpy as np

from gritd.estimator.effects import in_order
from gritd.estimator.effects.base import Effect
from gritd.estimator.model.forward import paper_contact
from gritd.estimator.stages.situation import Motion, OnSoil, advanced, situation_of
from gritd.estimator.terramechanics import linear, original
from gritd.estimator.terramechanics.integrals import Integrals, integrals
from gritd.estimator.terramechanics.linear import Shift
from gritd.estimator.terramechanics.soil import Array, Soil, Wheel

THETA_1 = (0.05, 1.45)  # [rad] range of the table; outside it the edge is used
SLIP = (-0.1, 1.0)
NODES = (14, 20)  # of θ₁ and i
DEGREE = (9, 13)
# of ln k, n and λ, between which a polynomial stands for the shift: about what priors leave open
STEP_LN_K, STEP_N, STEP_PEAK = 0.6, 0.15, 0.07
FARTHEST = 1.0  # of ln k: beyond it the shift stays as it is
POWERS, SLOPE = 6, 3  # of ln k: of the shift, and of its slope by n or λ
QUANTUM = 2.0**-30  # of a coefficient; the largest is about 0.2, and the table is good to 1e-4
# evaluated points: all stretches of the filter's memory, and the windows since they were last used
REMEMBERED = 256
ORDER = 24  # quadrature nodes in each zone
PEAK = 0.999  # of θₘ/θ₁: at the entry itself σₘ says nothing of the modulus
INTEGRALS = len(Integrals._fields)
PARTS = POWERS + 2 * (SLOPE + 1) + 1  # Δ₀ … Δ₁₄

Vector = tuple[float, ...]


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
        ordered, n = in_order(effects), float(soil.exponent)

        def shift(ln_k: float, exponent: float = 0.0, peak: float = 0.0) -> Array:
            """So far from the prior."""
            k = float(np.exp(self.ln_k + ln_k))
            varied = replace(soil, shear_modulus=k, exponent=n + exponent)
            moved = replace(wheel, c1=wheel.c1 + peak)
            return _shift(moved, varied, ordered, share, theta_1, slip)

        coefficients = _fitted(np.concatenate(_parts(shift)))
        # (DEGREE[0] + 1, DEGREE[1] + 1, 120)
        self.coefficients: Array = np.ascontiguousarray(coefficients.transpose(1, 2, 0))
        self._table = lru_cache(REMEMBERED)(self._tabulated)  # a window is looked at more than once

    def at(
        self,
        k: float,
        theta_1: float,
        slip: float,
        exponent: float = 0.0,
        c1: float = 0.0,
        c2: float = 0.0,
    ) -> Shift:
        """At a shear modulus k [m], θ₁ [rad] and slip i; exponent, c1 and c2 are added to the
        prior's.
        """
        far = log(k) - self.ln_k
        ln_k, peak = min(max(far, -FARTHEST), FARTHEST), c1 + c2 * slip
        t = self._table(theta_1, slip)  # each (3, 8)

        along_n, along_peak = _power_series(t[6:9], ln_k), _power_series(t[10:13], ln_k)
        value, by_theta_1, by_slip = (
            _power_series(t[:6], ln_k)
            + exponent * (along_n + exponent * t[9])
            + peak * (along_peak + peak * t[13] + exponent * t[14])
        )
        by_n = along_n[0] + (2.0 * exponent) * t[9][0] + peak * t[14][0]
        by_peak = along_peak[0] + (2.0 * peak) * t[13][0] + exponent * t[14][0]
        by_slip = by_slip + c2 * by_peak
        by_ln_k = (
            _slope_of_series(t[:6, 0], ln_k)
            + exponent * _slope_of_series(t[6:9, 0], ln_k)
            + peak * _slope_of_series(t[10:13, 0], ln_k)
        )
        if ln_k != far:
            by_ln_k = 0.0 * by_ln_k

        every = (value, by_theta_1, by_slip, by_ln_k, by_n, by_peak)
        return Shift(*[Integrals(*row.tolist()) for row in every])

    def _tabulated(self, theta_1: float, slip: float) -> Array:
        """Δ₀ … Δ₁₄ at one point, each with its derivatives by θ₁ and by i: (15, 3, 8)."""
        rows = np.array(_polynomials(*_unit(theta_1, THETA_1), DEGREE[0]))
        columns = np.array(_polynomials(*_unit(slip, SLIP), DEGREE[1]))

        # sums over an axis that is not the last are made term by term; (2 for θ₁, powers of i, q)
        along = np.add.reduce(rows[:, :, None, None] * self.coefficients, axis=1)
        value, by_slip = np.add.reduce(columns[:, :, None] * along[0], axis=1)
        by_theta_1 = np.add.reduce(columns[0][:, None] * along[1], axis=0)
        every = np.array((value, by_theta_1, by_slip)).reshape(3, PARTS, INTEGRALS)
        return np.ascontiguousarray(every.transpose(1, 0, 2))


def _parts(shift: Callable[..., Array]) -> list[Array]:
    """Δ₀ … Δ₁₄ from the shift so far from the prior."""
    nodes = [FARTHEST * x for x in _nodes((-1.0, 1.0), POWERS).tolist()]
    parts = _through(nodes, [shift(node) for node in nodes])
    here = shift(0.0)

    for name, step in (("exponent", STEP_N), ("peak", STEP_PEAK)):
        pairs = [
            (shift(ln_k, **{name: step}), shift(ln_k, **{name: -step}))
            for ln_k in (-STEP_LN_K, 0.0, STEP_LN_K)
        ]
        low, slope, high = [(more - less) / (2.0 * step) for more, less in pairs]
        more, less = pairs[1]
        parts += [
            slope,
            (high - low) / (2.0 * STEP_LN_K),
            (high - 2.0 * slope + low) / (2.0 * STEP_LN_K**2),
            (more - 2.0 * here + less) / (2.0 * step**2),
        ]
    return [*parts, _cross(shift)]


def _cross(shift: Callable[..., Array]) -> Array:
    """∂²/∂n∂λ."""
    n, peak = STEP_N, STEP_PEAK
    more = shift(0.0, n, peak) - shift(0.0, n, -peak)
    less = shift(0.0, -n, peak) - shift(0.0, -n, -peak)
    return (more - less) / (4.0 * n * peak)


def _through(nodes: list[float], values: list[Array]) -> list[Array]:
    """Coefficients of the powers of the polynomial with these values at the nodes."""
    weights = []  # of each value in each power, falling
    for node in nodes:
        others = [other for other in nodes if other != node]
        scale = 1.0
        for other in others:
            scale *= node - other
        weights.append(np.poly(others) / scale)

    stacked = np.array(values)
    rows = np.array(weights).T[::-1]  # (powers, nodes)
    return [np.add.reduce(row[:, None, None, None] * stacked, axis=0) for row in rows]


def _power_series(terms: Array, x: float) -> Array:
    """Σ termₙ xⁿ, by Horner's rule."""
    total: Array = terms[-1]
    for term in terms[-2::-1]:
        total = term + x * total
    return total


def _slope_of_series(terms: Array, x: float) -> Array:
    """Σ n termₙ xⁿ⁻¹; terms (n, 8)."""
    return _power_series(np.arange(1.0, len(terms))[:, None] * terms[1:], x)


def true_integrals(
    wheel: Wheel, soil: Soil, effects: tuple[Effect, ...], theta_1: Array, slip: Array
) -> Integrals:
    """A₁ … C₃ over θ₁ of the original stresses with the contact effects; θ₁, i and the results have
    one shape (n,).

    Forces are linear in c and σₘ, so three evaluations with unit soils pick the integrals out.
    """
    situation = _steady(wheel, soil, slip)
    for effect in effects:
        soil = effect.soil(soil, situation)
    law = paper_contact(wheel, situation)
    for effect in effects:
        law = effect.contact(law, situation)
    theta_m = np.clip(law.theta_m_ratio, 0.0, PEAK) * theta_1
    depth = (wheel.radius * (np.cos(theta_m) - np.cos(theta_1))) ** soil.exponent

    def forces(c: float, sigma_m: float, tan_phi: float) -> original.OriginalForces:
        return original.forces(
            wheel,
            Soil(c, tan_phi, soil.shear_modulus, soil.exponent, sigma_m / depth),
            theta_1,
            slip,
            theta_m=theta_m,
            theta_2=-law.theta_2_ratio * theta_1,
            mobilisation=law.mobilisation,
            side_slip=law.side_slip,
            by_sliding=law.by_sliding,
            across=law.across,
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


def _steady(wheel: Wheel, soil: Soil, slip: Array) -> OnSoil:
    """A wheel in steady forward motion on fresh soil, at no particular place or time."""
    motion = Motion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, wheel_acceleration=0.0)
    return advanced(
        OnSoil,
        situation_of(motion, wheel),
        slip=slip,
        direction=1.0,
        cohesion=soil.cohesion,
        tan_phi=soil.tan_phi,
        shear_modulus=soil.shear_modulus,
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
