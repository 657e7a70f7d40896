"""What the constants and the accepted effects of a fitted model cannot absorb.

Around its fit a model is linear in its unknowns: constants, effect parameters, tolerance. In units
of their prior they have unit normal priors. Stacking [whitened J; I] under [whitened residual; −u]
therefore turns the fit with priors into plain least squares, in which the strain of an unknown
against its prior is a residual like any other. For columns S of something more, the normal
equations with the model's unknowns eliminated are

    A = SᵀMS,   b = SᵀMr,   M the projection off the model's directions.

Of noise alone b has the covariance A.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import gammaincc

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Bools, Index
from gritd.tools.diagnose.tuning import TUNING


@dataclass(frozen=True, eq=False)
class WhitenedBlock:
    """Whitened columns (n, m) on consecutive values `rows`, of which there are many: seven digits
    are enough for what is searched.
    """

    rows: slice
    columns: NDArray[np.float32]


@dataclass(frozen=True)
class Projected:
    """A (m, m) and b (m,) of m columns."""

    a: Array
    b: Array

    def without(self, directions: Array) -> Projected:
        """With combinations of the columns, (m, k), projected out too."""
        turned = self.a @ directions
        gram = directions.T @ turned + np.eye(directions.shape[1]) / TUNING.fit.projected_prior**2
        taken = np.linalg.solve(gram, turned.T)
        return Projected(self.a - turned @ taken, self.b - taken.T @ (directions.T @ self.b))

    def without_columns(self, own: slice) -> Projected:
        """With a block of the columns projected out too."""
        return self.without(np.eye(len(self.a))[:, own])

    def combined(self, directions: Array) -> Projected:
        """Of combinations of the columns, (m, k)."""
        return Projected(directions.T @ self.a @ directions, directions.T @ self.b)

    def gain(self, own: Index) -> tuple[float, float]:
        """Nats that some of the columns, of unit normal weights, gain beyond what noise alone gives
        them in the mean, and its chance of as many: as of the gamma distribution of the same mean
        and variance (Satterthwaite 1946, Biometrics Bulletin 2, 110-114).
        """
        a, b = self.a[np.ix_(own, own)], self.b[own]
        known = np.maximum(np.linalg.eigvalsh(a), 0.0)
        share = 0.5 * known / (1.0 + known)  # of noise alone: Σ share χ² of one degree
        mean, variance = float(share.sum()), 2.0 * float(share @ share)
        if variance <= 0.0:
            return 0.0, 1.0

        value = 0.5 * float(b @ np.linalg.solve(a + np.eye(own.size), b))
        chance = float(gammaincc(mean**2 / variance, value * mean / variance))
        return max(value - mean, 0.0), chance


class Projection:
    """A model in the neighbourhood of its fit: projects its directions out of columns and of the
    residual.
    """

    def __init__(self, jacobian: Array, residual: Array, strain: Array) -> None:
        """jacobian (N, q) and residual (N,) whitened; strain (q,) the unknowns in prior σ."""
        self.jacobian, self.residual, self.strain = jacobian, residual, strain
        self._root = np.linalg.cholesky(jacobian.T @ jacobian + np.eye(jacobian.shape[1]))
        self._pulled = self._solved(jacobian.T @ residual - strain)

    def with_columns(self, columns: Array) -> Projection:
        """With more whitened columns (N, m) in the model, each one standard deviation."""
        return Projection(
            np.column_stack((self.jacobian, columns)),
            self.residual,
            np.append(self.strain, np.zeros(columns.shape[1])),
        )

    def of_rows(self, rows: Bools) -> Projection:
        """As the marked values (N,) alone tell it."""
        return Projection(self.jacobian * rows[:, None], self.residual * rows, self.strain)

    def project(self, columns: Array) -> tuple[Array, Array]:
        """A (m, m) and b (m,) of whitened columns (N, m)."""
        inside = self._solved(self.jacobian.T @ columns)
        return (
            columns.T @ columns - inside.T @ inside,
            columns.T @ self.residual - inside.T @ self._pulled,
        )

    def project_rows(self, columns: Array, rows: Bools) -> Projected:
        """The same for whitened columns (n, m) that are 0 outside n marked values, rows (N,)."""
        inside = self._solved(self.jacobian[rows].T @ columns)
        return Projected(
            columns.T @ columns - inside.T @ inside,
            columns.T @ self.residual[rows] - inside.T @ self._pulled,
        )

    def project_block(self, block: WhitenedBlock) -> tuple[Array, Array, Array]:
        """Of a block of columns taken one by one: squares (m,), coordinates in the model's
        directions (q, m), b (m,).
        """
        columns, jacobian = block.columns.astype(float), self.jacobian[block.rows]
        acting = np.any(jacobian != 0.0, axis=0)
        inside = np.zeros((jacobian.shape[1], columns.shape[1]))
        inside[acting] = jacobian[:, acting].T @ columns
        inside = self._solved(inside)

        b = columns.T @ self.residual[block.rows] - inside.T @ self._pulled
        return np.sum(columns**2, axis=0), inside, b

    def _solved(self, pulled: Array) -> Array:
        """Products with the Jacobian, (q, …), as coordinates in the model's directions."""
        return np.asarray(solve_triangular(self._root, pulled, lower=True, check_finite=False))
