"""What the constants and the accepted effects of a fitted model cannot absorb.

Around its fit a model is linear in its unknowns: constants, effect parameters, tolerance. In units
of their prior they have unit normal priors. Stacking [whitened J; I] under [whitened residual; −u]
therefore turns the fit with priors into plain least squares, in which the strain of an unknown
against its prior is a residual like any other. For columns S of something more, the normal
equations with the model's unknowns eliminated are

    A = SᵀMS,   b = SᵀMr,   M the projection off the model's directions,

of the recordings and of every surrogate of their noise alike.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Bools, Index
from gritd.tools.diagnose.tuning import TUNING


@dataclass(frozen=True)
class Surrogates:
    """What noise alone would record: whitened residuals (N, draws), strains of the unknowns (q,
    draws) in prior σ.
    """

    residuals: Array
    strains: Array

    def sized(self, unknowns: int) -> Surrogates:
        """The same for a model of so many unknowns."""
        known, draws = self.strains.shape
        if unknowns <= known:
            return Surrogates(self.residuals, self.strains[:unknowns])
        more = np.random.default_rng(unknowns).standard_normal((unknowns - known, draws))
        return Surrogates(self.residuals, np.vstack((self.strains, more)))


@dataclass(frozen=True, eq=False)
class Block:
    """Whitened columns (n, m) on consecutive values `rows`, of which there are many: seven digits
    are enough for what is searched.
    """

    rows: slice
    columns: NDArray[np.float32]


@dataclass(frozen=True)
class Projected:
    """A (m, m) and b (m, 1 + draws) of m columns: of the recordings first, then the surrogates."""

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


class Projection:
    """A model in the neighbourhood of its fit: projects its directions out of columns, of the
    residual and of surrogates.
    """

    def __init__(
        self, jacobian: Array, residual: Array, strain: Array, surrogates: Surrogates | None = None
    ) -> None:
        """jacobian (N, q) and residual (N,) whitened; strain (q,) the fitted unknowns in prior σ.

        Without surrogates the recordings alone count.
        """
        self.jacobian, self.residual, self.strain = jacobian, residual, strain
        self.surrogates, self._nulls = surrogates, _sized(surrogates, jacobian)
        self._root = np.linalg.cholesky(jacobian.T @ jacobian + np.eye(jacobian.shape[1]))

        nulls = jacobian.T @ self._nulls.residuals - self._nulls.strains
        every = np.column_stack((jacobian.T @ residual - strain, nulls))
        self._every_pulled = self._solved(every)  # of the recordings first, then the surrogates

    def with_columns(self, columns: Array) -> Projection:
        """With more whitened columns (N, m) in the model, each one standard deviation."""
        return Projection(
            np.column_stack((self.jacobian, columns)),
            self.residual,
            np.append(self.strain, np.zeros(columns.shape[1])),
            self.surrogates,
        )

    def of_rows(self, rows: Bools) -> Projection:
        """As the marked values (N,) alone tell it."""
        mask = rows[:, None].astype(float)
        drawn = self.surrogates
        if drawn is not None:
            drawn = Surrogates(drawn.residuals * mask, drawn.strains)
        return Projection(self.jacobian * mask, self.residual * mask[:, 0], self.strain, drawn)

    def project(self, columns: Array) -> tuple[Array, Array]:
        """A (m, m) and b (m,) of whitened columns (N, m) for the recordings."""
        inside = self._inside(columns)
        return (
            columns.T @ columns - inside.T @ inside,
            columns.T @ self.residual - inside.T @ self._every_pulled[:, 0],
        )

    def project_all(self, columns: Array) -> Projected:
        """The same of whitened columns (N, m) for the surrogates too."""
        return self._projected(columns, self._inside(columns), slice(None))

    def project_rows(self, columns: Array, rows: Bools) -> Projected:
        """The same for whitened columns (n, m) that are 0 outside n marked values, rows (N,)."""
        return self._projected(columns, self._solved(self.jacobian[rows].T @ columns), rows)

    def _projected(self, columns: Array, inside: Array, rows: Bools | slice) -> Projected:
        """From columns on some of the values, and their coordinates in the model's directions."""
        recorded, nulls = self.residual[rows], self._nulls.residuals[rows]
        own = np.column_stack((columns.T @ recorded, columns.T @ nulls))
        return Projected(
            columns.T @ columns - inside.T @ inside, own - inside.T @ self._every_pulled
        )

    def project_block(self, block: Block) -> tuple[Array, Array, Array]:
        """Of a block of columns taken one by one: squares (m,), coordinates in the model's
        directions (q, m), b (m, 1 + draws).
        """
        columns, jacobian = block.columns.astype(float), self.jacobian[block.rows]
        acting = np.any(jacobian != 0.0, axis=0)
        inside = np.zeros((jacobian.shape[1], columns.shape[1]))
        inside[acting] = jacobian[:, acting].T @ columns
        inside = self._solved(inside)

        recorded, nulls = self.residual[block.rows], self._nulls.residuals[block.rows]
        own = np.column_stack((columns.T @ recorded, columns.T @ nulls))
        return np.sum(columns**2, axis=0), inside, own - inside.T @ self._every_pulled

    def _inside(self, columns: Array) -> Array:
        """Coordinates of columns (N, m) in the model's directions (q, m)."""
        return self._solved(self.jacobian.T @ columns)

    def _solved(self, pulled: Array) -> Array:
        """Products with the Jacobian, (q, m), as coordinates in the model's directions."""
        return np.asarray(solve_triangular(self._root, pulled, lower=True, check_finite=False))


class ResizedProjections:
    """A model whose directions may have one of several sizes: what columns have in common with them
    is formed once for all.
    """

    def __init__(
        self, jacobian: Array, residual: Array, strain: Array, sizes: Sequence[Array]
    ) -> None:
        """jacobian (N, q) and residual (N,) whitened; strain (q,) the fitted unknowns in prior σ;
        sizes: factors (q,) of the directions, of each projection. One of 0 leaves its direction
        out.
        """
        self._jacobian, self._residual = jacobian, residual
        gram, pulled = jacobian.T @ jacobian, jacobian.T @ residual
        self._each = [_resized(gram, pulled, strain, size) for size in sizes]

    def project(self, columns: Array) -> Iterator[tuple[Array, Array]]:
        """A (m, m) and b (m,) of whitened columns (N, m) for the recordings, for each of the
        sizes.
        """
        pulled = self._jacobian.T @ columns
        squares, scores = columns.T @ columns, columns.T @ self._residual
        for one in self._each:
            inside = one.solved(one.size[:, None] * pulled[one.acting])
            yield squares - inside.T @ inside, scores - inside.T @ one.recorded


@dataclass(frozen=True, eq=False)
class _Resized:
    """acting: directions that are not left out (k,), of a size each; root (k, k) of their products
    and prior; recorded: the residual in these directions (k,).
    """

    acting: Index
    size: Array
    root: Array
    recorded: Array

    def solved(self, pulled: Array) -> Array:
        """L⁻¹ of vectors (k, …), with the root L (k, k)."""
        return np.asarray(solve_triangular(self.root, pulled, lower=True, check_finite=False))


def _resized(gram: Array, pulled: Array, strain: Array, sizes: Array) -> _Resized:
    acting = np.flatnonzero(sizes)
    size = sizes[acting]
    products = gram[np.ix_(acting, acting)] * size[:, None] * size
    root = np.asarray(np.linalg.cholesky(products + np.eye(acting.size)))
    one = _Resized(acting, size, root, np.zeros(0))
    return replace(one, recorded=one.solved(size * pulled[acting] - strain[acting]))


def _sized(surrogates: Surrogates | None, jacobian: Array) -> Surrogates:
    values, unknowns = jacobian.shape
    if surrogates is None:
        return Surrogates(np.zeros((values, 0)), np.zeros((unknowns, 0)))
    return surrogates.sized(unknowns)
