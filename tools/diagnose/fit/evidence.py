"""Evidence for an effect by linear algebra: how much likelier the recordings are with its signature
than without.

An effect of signature S and strength a ~ N(0, s²) has the log Bayes factor

    ln B(s) = ½ bᵀ(A + s⁻²I)⁻¹ b − ½ ln det(I + s²A),   A = SᵀMS,   b = SᵀMr,

with M the projection off the fitted model (projection.py), averaged over a few s about the expected
size, so that no single size is preferred. Strengths bounded to one side count only that side.
Source: Bayesian linear regression (Gelman et al., Bayesian Data Analysis, 3rd ed., ch. 14).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.shape import Candidate, Shape
from gritd.tools.diagnose.tuning import TUNING


def strength_sizes() -> Array:
    """Sizes (s,) of a strength that are tried, in units of the expected one."""
    return np.array(TUNING.fit.strength_sizes)


@dataclass(frozen=True)
class Signature:
    """What a candidate changes: derivative (N, p) of all values by each strength.

    columns: the derivatives, per expected size of the strength.
    sign:    of each strength, 1 where it is bounded to one side.
    fixed:   the values of an effect's other parameters for which this holds.
    prior:   log share among all that were tried of the same candidate.
    """

    of: Candidate
    columns: Array
    sign: tuple[int, ...]
    fixed: dict[str, float]
    prior: float = 0.0

    @property
    def shape(self) -> Shape:
        """Of a misfit without a name."""
        assert isinstance(self.of, Shape)
        return self.of


def log_sum(terms: Sequence[Array] | Sequence[float] | Array) -> Array:
    """ln Σ exp of terms (n, …) over the first axis. As scipy's logsumexp, which takes many times as
    long for few terms.
    """
    terms = np.asarray(terms)
    top = terms.max(axis=0)
    top = np.where(np.isfinite(top), top, 0.0)
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(np.exp(terms - top).sum(axis=0)) + top)


def log_bayes(a: Array, b: Array, sign: tuple[int, ...]) -> Array:
    """ln B of one signature, () or (draws,): A (p, p), b (p,) or (p, draws)."""
    values, vectors = np.linalg.eigh(0.5 * (a + a.T))
    values = np.maximum(values, 0.0)
    turned = vectors.T @ b

    parts = []
    for scale in strength_sizes():
        variance = 1.0 / (values + scale**-2)
        gain = 0.5 * (variance @ turned**2)
        part = gain - 0.5 * np.log1p(scale**2 * values).sum()
        parts.append(part + _one_sided(vectors, variance, turned, sign))
    return np.asarray(log_sum(parts) - np.log(len(strength_sizes())))


def _one_sided(vectors: Array, variance: Array, turned: Array, sign: tuple[int, ...]) -> Array:
    """ln of twice the posterior share on the allowed side, for each bounded strength."""
    total = np.zeros(turned.shape[1:])
    if not any(sign):
        return total
    mean = (vectors * variance) @ turned
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
    """ln B averaged over the subsets of strengths: A (p, p), b (p,) or (p, draws)."""
    parts = [
        log_bayes(a[np.ix_(s, s)], b[list(s)], tuple(sign[i] for i in s))
        for s in subsets(len(sign))
    ]
    return np.asarray(log_sum(parts) - np.log(len(parts)))


def log_evidence_singly(a: Array, b: Array) -> Array:
    """ln B (n, d) of each of n single columns: a (n,), b (n, d); averaged over the sizes."""
    scale = strength_sizes()[:, None, None]
    gain = 0.5 * b**2 / (a[:, None] + scale**-2) - 0.5 * np.log1p(scale**2 * a[:, None])
    return np.asarray(log_sum(gain) - np.log(len(strength_sizes())))
