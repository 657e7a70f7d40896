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


def log_bayes(a: Array, b: Array, sign: Sequence[int]) -> Array:
    """ln B (…) of columns together: A (…, p, p), b (…, p); sign: of each strength, 0 where it has
    no bound.
    """
    values, vectors = np.linalg.eigh(0.5 * (a + a.swapaxes(-1, -2)))
    values = np.maximum(values, 0.0)
    turned = np.einsum("...ij,...i->...j", vectors, b)

    parts = []
    for scale in strength_sizes():
        variance = 1.0 / (values + scale**-2)
        gain = 0.5 * np.sum(variance * turned**2, axis=-1)
        spread = 0.5 * np.log1p(scale**2 * values).sum(axis=-1)
        parts.append(gain - spread + _one_sided(vectors, variance, turned, sign))
    return np.asarray(log_sum(parts) - np.log(len(parts)))


def _one_sided(
    vectors: Array, variance: Array, turned: Array, sign: Sequence[int]
) -> Array | float:
    """ln of twice the posterior share (…) on the allowed side, for each bounded strength."""
    bounded = np.flatnonzero(np.asarray(sign))
    if not bounded.size:
        return 0.0
    own, side = vectors[..., bounded, :], np.asarray(sign)[bounded]
    mean = np.einsum("...ij,...j->...i", own, variance * turned)
    sigma = np.sqrt(np.einsum("...ij,...j->...i", own**2, variance))
    return np.asarray(np.sum(log_ndtr(side * mean / sigma) + np.log(2.0), axis=-1))


def log_bayes_alone(a: Array, b: Array, sign: Sequence[int] | int = 0) -> Array:
    """ln B (…, m) of each column alone: squares a (…, m), scores b (…, m)."""
    side, parts = np.asarray(sign), []
    for scale in strength_sizes():
        precision = a + scale**-2
        shown = log_ndtr(side * b / np.sqrt(precision)) + np.log(2.0)
        gain = 0.5 * b**2 / precision - 0.5 * np.log1p(scale**2 * a)
        parts.append(gain + np.where(side != 0, shown, 0.0))
    return np.asarray(log_sum(parts) - np.log(len(parts)))


def log_bayes_expected(a: Array) -> float:
    """ln B of strengths that have their expected size, in the mean over noise: squares a (p,)."""
    a, scale = np.maximum(a, 0.0), strength_sizes()[:, None]
    each = 0.5 * a * (a + 1.0) / (a + scale**-2) - 0.5 * np.log1p(scale**2 * a)
    return float(log_sum(each.sum(axis=1)) - np.log(len(scale)))


def log_evidence(a: Array, b: Array, sign: Sequence[int]) -> Array:
    """ln B (s,) averaged over all strengths together and each alone, through one of which an effect
    may act: A (s, p, p), b (s, p).
    """
    alone = log_bayes_alone(np.diagonal(a, axis1=1, axis2=2), b, sign)
    if len(sign) == 1:
        return np.asarray(alone[:, 0])
    parts = [log_bayes(a, b, sign), *alone.T]
    return np.asarray(log_sum(parts) - np.log(len(parts)))
