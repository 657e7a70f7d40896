"""The products of all columns beside a fit, and what is left of them for each size of the form's
discrepancy.

Around its fit a model is linear in its unknowns, each of a unit normal prior: constants and effect
parameters in prior σ, tolerances, other forms of its effects, and the discrepancy of form δ times
its sizes s. With the whitened columns F of all but δ, D of δ for sizes of 1, S of what is looked
for, and the residual r, the normal equations with F eliminated are

    L Lᵀ = I + FᵀF,   X = L⁻¹FᵀX for X = D, S, r,   G = [D S r]ᵀ[D S r] − [D S r]ᵀ[D S r] of these,

formed once. For each of some sizes s of δ

    M Mᵀ = I + s G_DD s,   y = M⁻¹ s G_Dr,   V = M⁻¹ s G_DS
    e₀(s) = ln p(s) − ½(G_rr + strain² − yᵀy) − Σ ln diag L − Σ ln diag M
    A(s) = G_SS − VᵀV,     b(s) = G_Sr − Vᵀy.

(Gelman et al., Bayesian Data Analysis, 3rd ed., ch. 14.) A constant that stands at its bound keeps
its prior width.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.columns import Columns, joined, whole
from gritd.tools.diagnose.fit.evidence import log_sum
from gritd.tools.diagnose.fit.marginal import Chosen
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.fit.random_effect import RandomEffect
from gritd.tools.diagnose.rig.interface import Bools, Index


@dataclass(frozen=True, eq=False)
class Sized:
    """One size of every discrepancy: which, its log evidence e₀ [nats]; of the columns of δ that
    act (k,) their size, the root M (k, k) and y (k,).
    """

    chosen: Chosen
    evidence: float
    acting: Index
    size: Array
    root: Array
    y: Array

    def solved(self, products: Array) -> Array:
        """M⁻¹ s G (k, m) of products G (d, m) with all columns of δ."""
        scaled = self.size[:, None] * products[self.acting]
        return np.asarray(solve_triangular(self.root, scaled, lower=True, check_finite=False))


class Gram:
    """A fit, and sizes of its discrepancy about those that it was fitted with."""

    def __init__(self, problem: Problem, model: Model, rows: Bools | None = None) -> None:
        """rows: marks the values (N,) that count; if not given, all."""
        forms, chosen = _terms(model)
        self._fixed = _fixed_columns(problem, model)
        self._form = joined(problem.stack.size, [f.whitened for f in forms])
        self._forms, self._residual = forms, model.fitted.residual
        if rows is not None:
            self._fixed, self._form = self._fixed.of_rows(rows), self._form.of_rows(rows)
            self._residual = self._residual * rows

        self._root = _root(self._fixed)
        strain = np.zeros(self._fixed.count)
        known = model.fitted.centre.size
        strain[:known] = model.fitted.centre * model.fitted.penalty[:known]
        self._pulled = _solved(self._root, self._fixed.pulled(self._residual) - strain)
        self._inside = _solved(self._root, self._fixed.products(self._form))

        gram = self._form.gram - self._inside.T @ self._inside
        score = self._form.pulled(self._residual) - self._inside.T @ self._pulled
        misfit = self._residual @ self._residual + strain @ strain - self._pulled @ self._pulled
        alone = -0.5 * float(misfit) - float(np.log(np.diag(self._root)).sum())
        self.sizes = [_sized(gram, score, alone, forms, some) for some in _about(chosen, forms)]

    @property
    def evidence(self) -> Array:
        """Log evidence e₀ (s,) of the fit alone for each of the sizes."""
        return np.array([one.evidence for one in self.sizes])

    @property
    def exact(self) -> int:
        """Which of the sizes are the smallest of all: no discrepancy."""
        return min(range(len(self.sizes)), key=lambda number: sum(self.sizes[number].chosen))

    def up_to(self, most: Chosen) -> float:
        """Log evidence of the fit alone, summed over the sizes that are none larger."""
        small = [
            s.evidence
            for s in self.sizes
            if all(n <= m for n, m in zip(s.chosen, most, strict=True))
        ]
        pairs = zip(self._forms, most, strict=True)
        prior = sum(float(log_sum(f.sizes.log_prior[: m + 1])) for f, m in pairs)
        return float(log_sum(small)) - prior

    @property
    def total(self) -> float:
        """Log evidence of the fit alone, summed over the sizes."""
        return float(log_sum(self.evidence))

    def project(self, columns: Array) -> tuple[Array, Array]:
        """A (s, m, m) and b (s, m) of whitened columns (N, m) for each of the sizes."""
        inside = _solved(self._root, self._fixed.pulled(columns))
        squares = columns.T @ columns - inside.T @ inside
        scores = columns.T @ self._residual - inside.T @ self._pulled
        shared = self._form.pulled(columns) - self._inside.T @ inside

        turned = [one.solved(shared) for one in self.sizes]
        a = np.stack([squares - v.T @ v for v in turned])
        b = np.stack([scores - v.T @ one.y for v, one in zip(turned, self.sizes, strict=True)])
        return a, b


def _terms(model: Model) -> tuple[Sequence[RandomEffect], Chosen]:
    """Of the model's form, then other forms of its effects, with their sizes; none of a plain
    fit.
    """
    return (model.marginal.terms, model.chosen) if model.marginal is not None else ((), ())


def _fixed_columns(problem: Problem, model: Model) -> Columns:
    """What has one size (N, q), each column one standard deviation."""
    fitted = model.fitted
    own = whole(fitted.own / fitted.penalty[: fitted.centre.size])
    return joined(problem.stack.size, (own, *(f.whitened for f in problem.fixed)))


def _sized(
    gram: Array, score: Array, alone: float, forms: Sequence[RandomEffect], chosen: Chosen
) -> Sized:
    values = [f.sizes.values[n] for f, n in zip(forms, chosen, strict=True)]
    widths = [f.columns.count for f in forms]
    every = np.repeat(np.array(values), widths)
    acting = np.flatnonzero(every)
    size = every[acting]

    products = gram[np.ix_(acting, acting)] * size[:, None] * size
    products[np.diag_indices_from(products)] += 1.0
    root = np.asarray(cholesky(products, lower=True, overwrite_a=True, check_finite=False))
    y = _solved(root, size * score[acting])

    prior = sum(float(f.sizes.log_prior[n]) for f, n in zip(forms, chosen, strict=True))
    spread = float(np.log(np.diag(root)).sum())
    return Sized(chosen, prior + alone + 0.5 * float(y @ y) - spread, acting, size, root, y)


def _about(chosen: Chosen, forms: Sequence[RandomEffect]) -> list[Chosen]:
    """Sizes that are tried: those of the fit, each varied alone, all smaller and larger by
    steps.
    """
    counts = [len(f.sizes.values) for f in forms]
    alone = [
        (*chosen[:i], n, *chosen[i + 1 :]) for i, count in enumerate(counts) for n in range(count)
    ]
    most = max(counts, default=1)
    steps = [
        tuple(min(max(n + k, 0), count - 1) for n, count in zip(chosen, counts, strict=True))
        for k in range(1 - most, most)
    ]
    return list(dict.fromkeys([chosen, *alone, *steps]))


def _root(columns: Columns) -> Array:
    """Cholesky root (q, q) of the products of columns (N, q) and their unit prior."""
    gram = columns.gram
    gram[np.diag_indices_from(gram)] += 1.0
    return np.asarray(cholesky(gram, lower=True, overwrite_a=True, check_finite=False))


def _solved(root: Array, right: Array) -> Array:
    return np.asarray(solve_triangular(root, right, lower=True, check_finite=False))
