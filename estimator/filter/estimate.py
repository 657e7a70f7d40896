"""The extended Kalman filter on c, tan φ and ln k, with considered nuisances (Schmidt).

Nuisances (nuisance.py) are errors of the calibration: constant, zero mean, of stated variance.
They, and ln k while
slip does not vary, are considered: their uncertainty and their correlation with the state take part
in every innovation covariance, but their own value and variance never change. Without them a filter
fed ten windows a second soon claims to know c far better than the calibration of the sensors
allows.

Two engines share one interface: `FilterpyEngine` is filterpy's ExtendedKalmanFilter with the
Schmidt gain, and `plain.PlainEngine` the same algebra in plain floats. Both use the Joseph form
with the gain that was really applied, zeroed rows included, so the covariance stays symmetric and
positive.
"""

from __future__ import annotations

from operator import mul
from typing import NamedTuple, Protocol

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

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


class Engine(Protocol):
    """The algebra of one step. It knows the nuisances' variances and holds no estimate of its own."""

    def update(self, estimate: Estimate, update: Update, consider_k: bool) -> Estimate:
        """Apply a measurement. With consider_k, ln k keeps its value and variance."""


class _SchmidtFilter(ExtendedKalmanFilter):  # type: ignore[misc]  # filterpy carries no types
    """filterpy's EKF, whose gain is set to zero for considered states before it is applied
    anywhere.
    """

    x: np.ndarray
    P: np.ndarray

    def consider(self, y: np.ndarray, H: np.ndarray, R: np.ndarray, considered: slice) -> None:
        cross = self.P @ H.T
        self.S = H @ cross + R
        self.K = cross @ np.linalg.inv(self.S)
        self.K[considered] = 0.0
        self.y = y
        self.x = self.x + self.K @ self.y
        kept = self._I - self.K @ H
        self.P = kept @ self.P @ kept.T + self.K @ R @ self.K.T


class FilterpyEngine:
    """filterpy behind the Engine interface: one augmented vector [state, nuisances]."""

    def __init__(self, nuisance_variances: Vector) -> None:
        self._size = size = STATES + len(nuisance_variances)
        self._prior = np.diag((*(0.0,) * STATES, *nuisance_variances))
        # made once: a filter's construction costs more than its update; every update sets all that
        # it reads
        self._filters = {m: _SchmidtFilter(dim_x=size, dim_z=m) for m in (1, 2)}

    def update(self, estimate: Estimate, update: Update, consider_k: bool) -> Estimate:
        ekf = self._filters[len(update.innovation)]
        ekf.x, ekf.P = np.zeros(self._size), self._prior.copy()
        ekf.x[:STATES], ekf.P[:STATES, :STATES] = estimate.x, estimate.P
        ekf.P[:STATES, STATES:] = estimate.cross
        ekf.P[STATES:, :STATES] = ekf.P[:STATES, STATES:].T
        H = np.array([h + g for h, g in zip(update.H, update.G, strict=True)])
        y, R = np.array(update.innovation), np.array(update.R)
        if consider_k or self._size > STATES:
            ekf.consider(y, H, R, slice(LN_K if consider_k else STATES, None))
        else:
            ekf.update(y, lambda _: H, lambda _: np.zeros_like(y), R=R)
        P = 0.5 * (ekf.P + ekf.P.T)
        return Estimate(
            tuple(ekf.x[:STATES].tolist()), _rows(P[:STATES, :STATES]), _rows(P[:STATES, STATES:])
        )


def _rows(matrix: np.ndarray) -> Matrix:
    return tuple(tuple(row) for row in matrix.tolist())


def predict(estimate: Estimate, walk: Vector) -> Estimate:
    """Random walk: add the variances `walk` (3,) to the diagonal of P."""
    (a, b, c), (_, d, e), (_, _, f) = estimate.P
    a, d, f = a + walk[0], d + walk[1], f + walk[2]
    return Estimate(estimate.x, ((a, b, c), (b, d, e), (c, e, f)), estimate.cross)


def crossed(estimate: Estimate, variances: Vector, h: Vector, g: Vector) -> tuple[Vector, Vector]:
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
    """Variance of a quantity with gradient h (3,) in the state and g (q,) in the nuisances; never
    negative.
    """
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
    total: float = sum(map(mul, a, b))
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
