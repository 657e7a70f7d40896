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

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.columns import Columns, columns_of, joined
from gritd.tools.diagnose.rig.interface import Bools


@dataclass(frozen=True, eq=False)
class WhitenedBlock:
    """Whitened columns (n, m) on consecutive values `rows`, of which there are many: seven digits
    are enough for what is searched.
    """

    rows: slice
    columns: NDArray[np.float32]


class Projection:
    """A model in the neighbourhood of its fit: projects its directions out of columns and of the
    residual.
    """

    def __init__(self, jacobian: Columns, residual: Array, strain: Array) -> None:
        """jacobian (N, q) and residual (N,) whitened; strain (q,) the unknowns in prior σ."""
        self.jacobian, self.residual, self.strain = jacobian, residual, strain
        self._root = np.linalg.cholesky(jacobian.gram + np.eye(jacobian.count))
        self._pulled = self._solved(jacobian.pulled(residual) - strain)

    def with_columns(self, columns: Array) -> Projection:
        """With more whitened columns (N, m) in the model, each one standard deviation."""
        return Projection(
            joined(len(columns), (self.jacobian, columns_of(columns))),
            self.residual,
            np.append(self.strain, np.zeros(columns.shape[1])),
        )

    def of_rows(self, rows: Bools) -> Projection:
        """As the marked values (N,) alone tell it."""
        return Projection(self.jacobian.of_rows(rows), self.residual * rows, self.strain)

    def project(self, columns: Array) -> tuple[Array, Array]:
        """A (m, m) and b (m,) of whitened columns (N, m)."""
        inside = self._solved(self.jacobian.pulled(columns))
        return (
            columns.T @ columns - inside.T @ inside,
            columns.T @ self.residual - inside.T @ self._pulled,
        )

    def project_block(self, block: WhitenedBlock) -> tuple[Array, Array, Array]:
        """Of a block of columns taken one by one: squares (m,), coordinates in the model's
        directions (q, m), b (m,).
        """
        columns = block.columns.astype(float)
        inside = self._solved(self.jacobian.pulled(columns, block.rows.start))

        b = columns.T @ self.residual[block.rows] - inside.T @ self._pulled
        return np.sum(columns**2, axis=0), inside, b

    def _solved(self, pulled: Array) -> Array:
        """Products with the Jacobian, (q, …), as coordinates in the model's directions."""
        return np.asarray(solve_triangular(self._root, pulled, lower=True, check_finite=False))
