"""What the extended Kalman filter knows, and the algebra on it.

The vector x (d,) holds c, tan φ and ln k, and behind them the errors that are the same in every
window (nuisance.py): of the calibration, of the place of the stress peak, of the exponent, of the
form of the equations. All of them have a stated prior and are estimated together. So the part of a
misfit that a calibration explains is not taken from the soil, and a thousand windows under one
condition do not claim more than the errors they share allow.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp
from struct import Struct
from typing import NamedTuple

import numpy as np

from gritd.estimator.compiled import arithmetic
from gritd.estimator.terramechanics.soil import Array

C = 0  # cohesion [kPa]
TAN_PHI = 1  # tangent of the internal friction angle [-]
LN_K = 2  # logarithm of the shear modulus k/m [-]
STATES = 3  # of the soil: the first of the vector
KPA = 1e3  # [Pa]; cohesion is scaled so that all three states are of order one

Vector = tuple[float, ...]
Matrix = tuple[Vector, ...]
_SIZE = 8  # [bytes] of a double


class Estimate(NamedTuple):
    """Mean and covariance of a vector (d,); see the module."""

    x: Vector  # (d,)
    packed: bytes  # covariance (d, d), row by row, as doubles of the processor
    # ln of the density of all measurements so far, up to a constant that depends on their number
    log_evidence: float = 0.0

    @property
    def P(self) -> Matrix:
        """Covariance (d, d)."""
        return rows(covariance(self))

    @property
    def soil_P(self) -> Matrix:
        """Covariance (3, 3) of c [kPa], tan φ and ln k."""
        size = len(self.x) * _SIZE
        return tuple([_ROW.unpack_from(self.packed, i * size) for i in range(STATES)])


_ROW = Struct("3d")


class Update(NamedTuple):
    """A vector measurement of m = 1 or 2 components, linearised at the present estimate."""

    innovation: Vector  # y (m,)
    H: Matrix  # (m, d)
    R: Matrix  # (m, m) noise

    def of(self, components: tuple[int, ...]) -> Update:
        """The measurement reduced to some of its components."""
        if len(components) == len(self.innovation):
            return self
        return Update(
            tuple([self.innovation[a] for a in components]),
            tuple([self.H[a] for a in components]),
            tuple([tuple([self.R[a][b] for b in components]) for a in components]),
        )


def made(x: Vector, P: Array, log_evidence: float = 0.0) -> Estimate:
    """An estimate from a covariance (d, d)."""
    return Estimate(x, np.ascontiguousarray(P, float).tobytes(), log_evidence)


def covariance(estimate: Estimate) -> Array:
    """P (d, d), for reading."""
    size = len(estimate.x)
    return np.frombuffer(estimate.packed).reshape(size, size)


def rows(matrix: Array) -> Matrix:
    """A matrix as tuples."""
    return tuple([tuple(row) for row in matrix.tolist()])


def predict(estimate: Estimate, walk: Vector) -> Estimate:
    """Random walk of the soil: add the variances `walk` (3,) to the diagonal of P."""
    packed = bytearray(estimate.packed)
    P, step = memoryview(packed).cast("d"), len(estimate.x) + 1
    for state, more in enumerate(walk):
        P[state * step] += more
    return Estimate(estimate.x, bytes(packed), estimate.log_evidence)


def variance(estimate: Estimate, h: Vector) -> float:
    """Variance of a quantity with gradient h (d,); never negative."""
    if arithmetic.BUILT:
        return arithmetic.variance(estimate.packed, h)
    return plain_variance(estimate, h)


def plain_variance(estimate: Estimate, h: Vector) -> float:
    """`variance` in Python, to the same bits as compiled."""
    return max(plain_dot(h, times(covariance(estimate), h)), 0.0)


def times(P: Array, h: Vector) -> Vector:
    """P h (d,) of a symmetric P (d, d), term by term."""
    # a reduction over the first axis adds row to row, in their order
    product = np.add.reduce(P * np.array(h)[:, None], axis=0)
    return tuple(product.tolist())


def mixed(members: Sequence[Estimate], weights: Sequence[float]) -> Estimate:
    """Mean and covariance of a mixture of estimates with weights that sum to one."""
    if len(members) == 1:
        return members[0]
    if arithmetic.BUILT:
        x, packed = arithmetic.mixed([(e.x, e.packed) for e in members], tuple(weights))
        return Estimate(x, packed)
    return plain_mixed(members, weights)


def plain_mixed(members: Sequence[Estimate], weights: Sequence[float]) -> Estimate:
    """`mixed` in Python, to the same bits as compiled."""
    x = np.zeros(len(members[0].x))
    for estimate, weight in zip(members, weights, strict=True):
        x = x + weight * np.array(estimate.x)

    P = np.zeros((x.size, x.size))
    for estimate, weight in zip(members, weights, strict=True):
        off = np.array(estimate.x) - x
        P = P + weight * (covariance(estimate) + off[:, None] * off)
    return made(tuple(x.tolist()), P)


def soil(estimate: Estimate) -> tuple[float, float, float]:
    """c [Pa], tan φ [-], k [m] of a state."""
    c, tan_phi, ln_k = estimate.x[:STATES]
    return c * KPA, tan_phi, exp(ln_k)


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


def project(estimate: Estimate, bounds: Sequence[tuple[float, float]]) -> Estimate:
    """Move states of the soil that left their bounds back to the bound, and all that is correlated
    with them along.

    The covariance is kept: a bound is knowledge of the state, not a measurement that narrows it.
    """
    x = estimate.x
    if all([low <= value <= high for value, (low, high) in zip(x, bounds, strict=False)]):
        return estimate

    P, moved = covariance(estimate), np.array(x)
    for j, (low, high) in enumerate(bounds):
        step = min(max(float(moved[j]), low), high) - float(moved[j])
        if step != 0.0 and P[j, j] > 0.0:
            moved = moved + P[:, j] / P[j, j] * step

    clamped = moved.tolist()
    for j, (low, high) in enumerate(bounds):
        clamped[j] = min(max(clamped[j], low), high)
    return estimate._replace(x=tuple(clamped))
