"""The products of all columns beside a fit, and what is left of them for each size of the form's
discrepancy.

Around its fit a model is linear in its unknowns, each of a unit normal prior: constants and effect
parameters in prior σ, tolerances, other forms of its effects, and the discrepancy of form δ times
its sizes s. With the whitened columns F of all but δ, S of what is looked for, and the residual r,
of whose products with one another fit/parted.py leaves G(s) where δ is eliminated:

    M Mᵀ = I + G_FF,   y = M⁻¹ G_Fr,   V = M⁻¹ G_FS
    e₀(s) = ln p(s) − ½(G_rr + strain² − yᵀy) − Σ ln diag M − ½ ln det
    A(s) = G_SS − VᵀV,     b(s) = G_Sr − Vᵀy.

(Gelman et al., Bayesian Data Analysis, 3rd ed., ch. 14.) A constant that stands at its bound keeps
its prior width.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import log_sum
from gritd.tools.diagnose.fit.marginal import Chosen
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.parted import Parted
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.fit.random_effect import RandomEffect
from gritd.tools.diagnose.rig.interface import Bools


@dataclass(frozen=True, eq=False)
class Sized:
    """One size of every term: which, its log evidence e₀ [nats]; factors (r,) of the columns F, the
    root M (r, r) and y (r,).
    """

    chosen: Chosen
    evidence: float
    factor: Array
    root: Array
    y: Array


class Gram:
    """A fit, and sizes of its discrepancy about those that it was fitted with."""

    def __init__(self, problem: Problem, model: Model, rows: Bools | None = None) -> None:
        """rows: marks the values (N,) that count; if not given, all."""
        forms, chosen = _terms(model)
        fitted, fixed = model.fitted, problem.fixed
        self._own = fitted.own / fitted.penalty[: fitted.centre.size]
        self._residual = fitted.residual
        if rows is not None:
            self._own, self._residual = self._own * rows[:, None], self._residual * rows
            forms, fixed = (tuple(_of_rows(f, rows) for f in each) for each in (forms, fixed))

        self._forms = forms
        self._parted = Parted(self._own, fixed, forms, self._residual)
        self._strain = fitted.centre * fitted.penalty[: fitted.centre.size]
        self.sizes = [self._sized(some) for some in _about(chosen, forms)]

    def _sized(self, chosen: Chosen) -> Sized:
        left, factor, det = self._parted.left(chosen)
        products, score = left[:-1, :-1], left[:-1, -1]
        products[np.diag_indices_from(products)] += 1.0
        score[: self._strain.size] -= self._strain
        root = np.asarray(cholesky(products, lower=True, check_finite=False))
        y = _solved(root, score)

        misfit = left[-1, -1] + self._strain @ self._strain - y @ y
        spread = float(np.log(np.diag(root)).sum()) + 0.5 * det
        prior = sum(f.sizes.log_prior[n] for f, n in zip(self._forms, chosen, strict=True))
        return Sized(chosen, float(prior - 0.5 * misfit - spread), factor[:-1], root, y)

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
        pulled = [f.whitened.pulled(columns) for f in self._parted.rest]
        scores = self._residual @ columns
        whole = np.vstack((self._own.T @ columns, *pulled, scores, columns.T @ columns))
        taken = self._taken(columns)

        a, b = [], []
        for one in self.sizes:
            sizes, count = self._parted.sizes(one.chosen), len(one.y)
            left = whole - sum(of_size[sizes[number]] for number, of_size in taken.items())
            v = _solved(one.root, one.factor[:, None] * left[:count])
            a.append(left[count + 1 :] - v.T @ v)
            b.append(left[count] - v.T @ one.y)
        return np.stack(a), np.stack(b)

    def _taken(self, columns: Array) -> dict[int, dict[float, Array]]:
        """What a term that acts on values of its own takes of the products of F, the residual and
        columns (N, m) with these (r + 1 + m, m), by its number and size.
        """
        taken = {}
        for number, part in self._parted.apart.items():
            turned = part.turned(columns)
            beside = np.hstack((part.beside, turned)).T
            sizes = {self._parted.sizes(one.chosen)[number] for one in self.sizes}
            taken[number] = {s: beside @ (part.share(s)[:, None] * turned) for s in sizes}
        return taken


def _of_rows(term: RandomEffect, rows: Bools) -> RandomEffect:
    """As the marked values (N,) alone tell it."""
    return replace(term, whitened=term.whitened.of_rows(rows))


def _terms(model: Model) -> tuple[Sequence[RandomEffect], Chosen]:
    """Of the model's form, then other forms of its effects, with their sizes; none of a plain
    fit.
    """
    return (model.marginal.terms, model.chosen) if model.marginal is not None else ((), ())


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


def _solved(root: Array, right: Array) -> Array:
    return np.asarray(solve_triangular(root, right, lower=True, check_finite=False))
