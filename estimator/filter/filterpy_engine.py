"""The filter of filterpy behind `engine.Engine`: the one module that knows filterpy."""

from __future__ import annotations

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from gritd.estimator.filter.estimate import LN_K, STATES, Estimate, Matrix, Update, Vector


class _SchmidtFilter(ExtendedKalmanFilter):  # type: ignore[misc]  # filterpy carries no types
    """filterpy's EKF, whose gain is set to zero for considered states before it is applied
    anywhere.
    """

    x: np.ndarray
    P: np.ndarray

    def consider(self, y: np.ndarray, H: np.ndarray, R: np.ndarray, considered: slice) -> None:
        """One update by innovations y (m,) with derivatives H (m, n) and covariance R (m, m), in
        the units of measurement and state; the `considered` part of the state keeps its mean.
        """
        cross = self.P @ H.T
        self.S = H @ cross + R
        self.K = cross @ np.linalg.inv(self.S)
        self.K[considered] = 0.0
        self.y = y
        self.x = self.x + self.K @ self.y
        kept = self._I - self.K @ H
        self.P = kept @ self.P @ kept.T + self.K @ R @ self.K.T


class FilterpyEngine:
    """One augmented vector [state, nuisances], (3 + q,)."""

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
