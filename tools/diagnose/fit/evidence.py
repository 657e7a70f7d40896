"""Evidence for an effect by linear algebra: how much likelier the recordings are with its signature
than without.

Unknowns of the base model (soil, calibration, tolerance) have unit normal priors, so stacking
[whitened J; I] under [whitened residual; −u] turns the fit with priors into plain least squares, in
which the strain of a parameter against its prior is a residual like any other. An effect of
signature S and strength a ~ N(0, s²) then has the log Bayes factor

    ln B(s) = ½ bᵀ(A + s⁻²I)⁻¹ b − ½ ln det(I + s²A),   A = SᵀMS,  b = SᵀMr,  M the projection off
    the base model,

averaged over a few s about the expected size, so that no single size is preferred. Strengths
bounded to one side count only that side. Source: Bayesian linear regression (Gelman et al.,
Bayesian Data Analysis, 3rd ed., ch. 14).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr, logsumexp

from gritd.estimator.terramechanics.soil import Array

SCALES = np.array([0.1, 0.3, 1.0, 3.0])  # sizes of a strength tried, in units of the expected one


@dataclass(frozen=True)
class Signature:
    """Derivative of all values by each strength, per expected size (N, p); sign: 1 where bounded to
    one side.
    """

    name: str
    columns: Array
    sign: tuple[int, ...]
    shape: dict[str, float]
    prior: float = 0.0  # log share among the shapes of the same name, those not tried included


class Base:
    """The base model in the neighbourhood of its fit: projects its directions out of signatures and
    residuals.
    """

    def __init__(self, jacobian: Array, residual: Array, u: Array) -> None:
        """jacobian (N, q) and residual (N,) whitened; u (q,) the fitted constants in prior σ."""
        self.jacobian, self.residual, self.u = jacobian, residual, u
        self.root = np.linalg.cholesky(jacobian.T @ jacobian + np.eye(jacobian.shape[1]))
        self._pulled = np.linalg.solve(self.root, jacobian.T @ residual - u)

    @property
    def covariance(self) -> Array:
        inverse = np.linalg.inv(self.root)
        return inverse.T @ inverse

    @property
    def misfit(self) -> float:
        """Whitened squares plus prior strain at the linear optimum."""
        return float(self.residual @ self.residual + self.u @ self.u - self._pulled @ self._pulled)

    def taken(self, columns: Array) -> Array:
        """Coordinates of columns (N, m) in the base model's directions (q, m)."""
        return np.linalg.solve(self.root, self.jacobian.T @ columns)

    def projected(self, columns: Array) -> tuple[Array, Array]:
        """A (m, m) and b (m,) of the columns with the base model projected out."""
        inside = self.taken(columns)
        return (
            columns.T @ columns - inside.T @ inside,
            columns.T @ self.residual - inside.T @ self._pulled,
        )

    def scores(self, columns: Array, noise: Array, strain: Array) -> Array:
        """b (m, draws) for surrogate residuals (N, draws) and strains (q, draws), both of unit
        noise.
        """
        pulled = np.linalg.solve(self.root, self.jacobian.T @ noise - strain)
        return columns.T @ noise - self.taken(columns).T @ pulled


def log_bayes(a: Array, b: Array, sign: tuple[int, ...]) -> Array:
    """ln B of one signature: A (p, p), b (p,) or (p, draws); the result has the shape of the draws."""
    values, vectors = np.linalg.eigh(0.5 * (a + a.T))
    values = np.maximum(values, 0.0)
    turned = vectors.T @ b
    parts = []
    for scale in SCALES:
        variance = 1.0 / (values + scale**-2)
        gain = 0.5 * np.tensordot(variance, turned**2, axes=(0, 0))
        part = gain - 0.5 * np.log1p(scale**2 * values).sum()
        parts.append(part + _one_sided(vectors, variance, turned, sign))
    return np.asarray(logsumexp(np.stack(parts), axis=0) - np.log(len(SCALES)))


def _one_sided(vectors: Array, variance: Array, turned: Array, sign: tuple[int, ...]) -> Array:
    """ln of twice the posterior share on the allowed side, for each bounded strength."""
    total = np.zeros(turned.shape[1:])
    if not any(sign):
        return total
    mean = np.tensordot(vectors * variance, turned, axes=(1, 0))
    sigma = np.sqrt((vectors**2) @ variance)
    for i, side in enumerate(sign):
        if side:
            total = total + log_ndtr(side * mean[i] / sigma[i]) + np.log(2.0)
    return total


def subsets(count: int) -> list[tuple[int, ...]]:
    """All strengths together, and each alone: an effect may act through one of them only."""
    everything = tuple(range(count))
    return [everything] if count == 1 else [everything, *((i,) for i in everything)]


def log_evidence(a: Array, b: Array, sign: tuple[int, ...]) -> Array:
    """ln B averaged over the subsets of strengths."""
    parts = [
        log_bayes(a[np.ix_(s, s)], b[list(s)], tuple(sign[i] for i in s))
        for s in subsets(len(sign))
    ]
    return np.asarray(logsumexp(np.stack(parts), axis=0) - np.log(len(parts)))
