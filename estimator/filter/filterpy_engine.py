"""The filter of filterpy behind `engine.Engine`: the one module that knows filterpy."""

from __future__ import annotations

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from gritd.estimator.filter.estimate import Estimate, Update, covariance, made


class FilterpyEngine:
    """Made anew for every size of vector, which is one as a rule."""

    def __init__(self) -> None:
        # a filter's construction costs more than its update; every update sets all that it reads
        self._filters: dict[tuple[int, int], ExtendedKalmanFilter] = {}

    def update(self, estimate: Estimate, update: Update) -> Estimate:
        size, components = len(estimate.x), len(update.innovation)
        ekf = self._filters.get((size, components))
        if ekf is None:
            ekf = ExtendedKalmanFilter(dim_x=size, dim_z=components)
            self._filters[size, components] = ekf

        ekf.x, ekf.P = np.array(estimate.x), covariance(estimate).copy()
        y, H, R = (np.array(part) for part in update)
        ekf.update(y, lambda _: H, lambda _: np.zeros_like(y), R=R)

        sign, size_of_s = np.linalg.slogdet(ekf.S)
        if sign <= 0.0:
            raise ZeroDivisionError("the covariance of the innovations is singular")
        evidence = -0.5 * float(y @ np.linalg.solve(ekf.S, y)) - 0.5 * float(size_of_s)
        P = 0.5 * (ekf.P + ekf.P.T)
        return made(tuple(ekf.x.tolist()), P, estimate.log_evidence + evidence)
