"""What the extended Kalman filter knows of c, tan φ and ln k, and the algebra on it.

Nuisances (nuisance.py) are errors of the calibration: constant, zero mean, of stated variance.
They, and ln k while slip does not vary, are considered (Schmidt): their uncertainty and their
correlation with the state take part in every innovation covariance, but their own value and
variance never change. Without them a filter fed ten windows a second soon claims to know c far
better than the calibration of the sensors allows.
"""

from __future__ import annotations

from operator import mul
from typing import NamedTuple

from gritd.estimator.compiled import arithmetic

C = 0  # cohesion [kPa]
TAN_PHI = 1  # tangent of the internal friction angle [-]
LN_K = 2  # logarithm of the shear modulus k/m [-]
STATES = 3
KPA = 1e3  # [Pa]; cohesion is scaled so that all three states are of order one

Vector = tuple[float, ...]
Matrix = tuple[Vector, ...]


class Estimate(NamedTuple):
    """Mean and covariance of [c, tan φ, ln k], and their correlation with the q nuisances."""

    x: Vector  # (3,)
    P: Matrix  # (3, 3)
    cross: Matrix  # (3, q) covariance of the state with each nuisance


class Update(NamedTuple):
    """A vector measurement of m = 1 or 2 components, linearised at the present estimate."""

    innovation: Vector  # y (m,)
    H: Matrix  # (m, 3) with respect to the state
    G: Matrix  # (m, q) with respect to the nuisances
    R: Matrix  # (m, m) noise


def predict(estimate: Estimate, walk: Vector) -> Estimate:
    """Random walk: add the variances `walk` (3,) to the diagonal of P."""
    (a, b, c), (_, d, e), (_, _, f) = estimate.P
    a, d, f = a + walk[0], d + walk[1], f + walk[2]
    return Estimate(estimate.x, ((a, b, c), (b, d, e), (c, e, f)), estimate.cross)


def cross_covariances(
    estimate: Estimate, variances: Vector, h: Vector, g: Vector
) -> tuple[Vector, Vector]:
    """Covariance of the state (3,) and of the nuisances (q,) with a quantity of gradient h (3,) and
    g (q,).
    """
    h0, h1, h2 = h
    (p00, p01, p02), (_, p11, p12), (_, _, p22) = estimate.P
    c0, c1, c2 = estimate.cross
    state = (
        p00 * h0 + p01 * h1 + p02 * h2 + dot(c0, g),
        p01 * h0 + p11 * h1 + p12 * h2 + dot(c1, g),
        p02 * h0 + p12 * h1 + p22 * h2 + dot(c2, g),
    )

    nuisance = [
        a * h0 + b * h1 + c * h2 + v * w
        for a, b, c, v, w in zip(c0, c1, c2, variances, g, strict=True)
    ]
    return state, tuple(nuisance)


def variance(estimate: Estimate, variances: Vector, h: Vector, g: Vector) -> float:
    """Variance of a quantity with gradient h (3,) in the state and g (q,) in the nuisances, or ()
    where none of them is felt; never negative.
    """
    if arithmetic.BUILT:
        return arithmetic.variance(estimate.P, estimate.cross, variances, h, g)
    return plain_variance(estimate, variances, h, g)


def plain_variance(estimate: Estimate, variances: Vector, h: Vector, g: Vector) -> float:
    """`variance` in plain floats, to the same bits as compiled."""
    (p00, p01, p02), (_, p11, p12), (_, _, p22) = estimate.P
    (h0, h1, h2), (c0, c1, c2) = h, estimate.cross

    own = (
        p00 * h0 * h0
        + p11 * h1 * h1
        + p22 * h2 * h2
        + 2.0 * (p01 * h0 * h1 + p02 * h0 * h2 + p12 * h1 * h2)
    )

    shared = h0 * dot(c0, g) + h1 * dot(c1, g) + h2 * dot(c2, g)
    return max(own + 2.0 * shared + dot(variances, tuple(map(mul, g, g))), 0.0)


def dot(a: Vector, b: Vector) -> float:
    """Σ aᵢbᵢ over the shorter of both."""
    return arithmetic.dot(a, b) if arithmetic.BUILT else plain_dot(a, b)


def plain_dot(a: Vector, b: Vector) -> float:
    """`dot` in plain floats, to the same bits as compiled: term by term, since newer versions of
    Python compensate what `sum` rounds.
    """
    total = 0.0
    for u, v in zip(a, b, strict=False):
        total += u * v
    return total


def project(estimate: Estimate, bounds: tuple[tuple[float, float], ...]) -> Estimate:
    """Move a state that left its bounds back to the bound, and the states correlated with it along.

    The covariance is kept: a bound is knowledge of the state, not a measurement that narrows it.
    """
    if all([low <= value <= high for value, (low, high) in zip(estimate.x, bounds, strict=True)]):
        return estimate

    x, P = list(estimate.x), estimate.P
    for j, (low, high) in enumerate(bounds):
        step = min(max(x[j], low), high) - x[j]
        if step != 0.0:
            x = [value + P[i][j] / P[j][j] * step for i, value in enumerate(x)]

    clamped = tuple(
        min(max(value, low), high) for value, (low, high) in zip(x, bounds, strict=True)
    )
    return Estimate(clamped, P, estimate.cross)
