"""The saturated mean: all that could explain a channel, so that it is not taken for noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Index
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SQUARE


@dataclass(frozen=True)
class Explainable:
    """Columns of which the leading directions count (N, p), and columns that all count (N, r)."""

    leading: Array
    whole: Array


def saturated_mean(residual: Array, columns: Array, sure: Array, cells: Index) -> Array:
    """Means of the cells, the columns that all count, and the leading directions of the others;
    orthonormal.

    Of the others those that would explain some of the residual (n,) at their expected size.
    """
    held = (cells[:, None] == np.unique(cells[cells >= 0])).astype(float)
    held = np.column_stack((held, sure[:, np.any(sure != 0.0, axis=0)]))
    held = basis(held, held.shape[1])

    beside = columns - held @ (held.T @ columns)
    acting = np.linalg.norm(beside, axis=0) > TUNING.noise.slight_column * np.linalg.norm(residual)
    return np.column_stack((held, basis(beside[:, acting])))


def basis(columns: Array, most: int | None = None) -> Array:
    """Orthonormal columns (n, k) that span most of what columns (n, m) span, k ≤ n/4."""
    scale = np.linalg.norm(columns, axis=0)
    columns = columns[:, scale > 0.0] / scale[scale > 0.0]
    if not columns.size:
        return np.zeros((columns.shape[0], 0))

    most = TUNING.noise.saturated_columns if most is None else most
    values, vectors = np.linalg.eigh(columns.T @ columns)
    most = max(min(columns.shape[0] // TUNING.noise.values_per_column, most), 1)
    kept = np.flatnonzero(values > TUNING.numerics.rank * max(values[-1], SQUARE))[-most:]
    basis: Array = columns @ (vectors[:, kept] / np.sqrt(values[kept]))
    return basis
