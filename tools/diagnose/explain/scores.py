"""Columns beside the base model and what noise alone would show of them, with some of them taken
out again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import SCALES
from gritd.tools.diagnose.rig.interface import Bools
from gritd.tools.diagnose.search.search import Model, Search

WIDE = 3.0  # prior standard deviation of what is taken out, in expected sizes


@dataclass(frozen=True)
class Scores:
    """A (m, m) = SᵀMS and b (m, 1 + draws) = SᵀM[r, nulls] of m columns S, with M the projection
    off the base model.
    """

    a: Array
    b: Array

    def without(self, directions: Array) -> Scores:
        """With combinations of the columns, (m, k), fitted beside the base model too."""
        turned = self.a @ directions
        gram = directions.T @ turned + np.eye(directions.shape[1]) / WIDE**2
        taken = np.linalg.solve(gram, turned.T)
        return Scores(self.a - turned @ taken, self.b - taken.T @ (directions.T @ self.b))

    def without_columns(self, own: slice) -> Scores:
        """With a block of the columns fitted beside the base model too."""
        return self.without(np.eye(len(self.a))[:, own])


class Beside:
    """The base model, the residual and every surrogate, ready for columns of some of the values."""

    def __init__(self, search: Search, model: Model) -> None:
        self._noise, self._base = search.problem.noise, model.fitted.base()
        noise, strain = search.draws
        self._both = np.column_stack((self._base.residual, noise))
        strains = np.column_stack(
            (self._base.u, np.resize(strain, (self._base.u.size, strain.shape[1])))
        )
        self._pulled = np.linalg.solve(
            self._base.root, self._base.jacobian.T @ self._both - strains
        )

    def scores(self, columns: Array, rows: Bools) -> Scores:
        """Of columns (rows, m) in the channels' units; rows (N,) holds every value of the channels
        it touches.
        """
        ready = np.asarray(self._noise.whitener[rows][:, rows] @ columns)
        inside = np.linalg.solve(self._base.root, self._base.jacobian[rows].T @ ready)
        return Scores(
            ready.T @ ready - inside.T @ inside,
            ready.T @ self._both[rows] - inside.T @ self._pulled,
        )


def alone(a: Array, b: Array) -> Array:
    """Log Bayes factor (n, d) of each of n single columns: a (n,), b (n, d); averaged over SCALES."""
    scale = SCALES[:, None, None]
    gain = 0.5 * b**2 / (a[:, None] + scale**-2) - 0.5 * np.log1p(scale**2 * a[:, None])
    return np.asarray(logsumexp(gain, axis=0) - np.log(len(SCALES)))
