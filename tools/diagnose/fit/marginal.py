"""The evidence of a fit, averaged over the sizes of its terms.

Around its optimum a fit is linear in all its unknowns, so for any sizes of the terms the
evidence is a matter of the products of the columns, which are formed once:

    ln Z(s) = −½ (rᵀr + |strain|² − bᵀA⁻¹b + ln det A − ln det P),   A = CᵀC + P

with the columns C (Jacobian, tolerance, terms times their sizes), their prior precisions P and
b = Cᵀr − P centre (Laplace's approximation: MacKay 2003, ch. 27). The strengths of effects have the
screen's prior: several sizes, and of each effect all strengths or one alone. A parameter that
stands at its bound is held there: it keeps the density of its prior and has no width of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import log_bayes, log_sum
from gritd.tools.diagnose.fit.problem import Fitted, Free
from gritd.tools.diagnose.fit.random_effect import RandomEffect, products
from gritd.tools.diagnose.rig.interface import Bools, Index
from gritd.tools.diagnose.tuning import TUNING

Chosen = tuple[int, ...]  # of each term, which of its sizes


@dataclass(frozen=True, eq=False)
class _Eliminated:
    """What is left of m kept columns, p strengths and the residual when all else is eliminated.

    gram (m, m), to_strong (m, p), pull (m,) of the kept columns without prior; strong (p, p),
    strong_pull (p,), centre (p,) of the strengths; misfit and spread of what was eliminated.
    """

    gram: Array
    to_strong: Array
    pull: Array
    strong: Array
    strong_pull: Array
    centre: Array
    misfit: float
    spread: float


@dataclass(frozen=True, eq=False)
class _Varied:
    """products (n + 1, n + 1) of all columns and the residual without what has but one size; spread
    of that; acting: the unknowns (n,) that are left.
    """

    products: Array
    spread: float
    acting: Bools


class Marginal:
    """A fit without its terms, and the terms that it may have."""

    def __init__(
        self, fitted: Fitted, fixed: Sequence[RandomEffect], terms: Sequence[RandomEffect]
    ) -> None:
        """fixed: what every fit has."""
        self.terms, known = tuple(terms), len(fitted.u) + len(fitted.x)
        self._fitted, self._fixed = fitted, tuple(fixed)
        allowed = sum(f.columns.count for f in fixed)
        self._ends = known + np.cumsum([0, allowed, *(f.columns.count for f in terms)])

        size = int(self._ends[-1])
        self._centre, self._weight = np.zeros(size), np.ones(size)
        self._centre[:known] = np.concatenate((fitted.u, fitted.x))
        self._weight[:known] = fitted.penalty[:known]
        self._held = np.zeros(size, bool)
        self._held[:known] = fitted.held

        first = len(fitted.u)
        self._strong = np.zeros(size, bool)
        self._strong[first:known] = [f.parameter.role == "strength" for f in fitted.free]
        self._strengths = [
            f
            for i, f in enumerate(fitted.free)
            if self._strong[first + i] and not fitted.held[first + i]
        ]
        self._known: dict[Chosen, float] = {}
        self._filled: list[set[Chosen]] = [set() for _ in self.terms]

    def beside(self, terms: Sequence[RandomEffect]) -> Marginal:
        """The same fit with further terms."""
        return Marginal(self._fitted, self._fixed, (*self.terms, *terms))

    def log_evidence(self, chosen: Chosen) -> float:
        """For given sizes, their prior counted."""
        if chosen not in self._known:
            self._known[chosen] = self._log_evidence(chosen)
        return self._known[chosen]

    def likeliest(self, start: Chosen) -> tuple[Chosen, float]:
        """The likeliest sizes, found one term at a time, and the log evidence averaged over
        the sizes about them.
        """
        chosen = start
        before: Chosen | None = None
        while chosen != before:
            before = chosen
            for number in range(len(self.terms)):
                chosen = max(self._along(chosen, number), key=self.log_evidence)

        top = average = self.log_evidence(chosen)
        for number in range(len(self.terms)):
            values = [self.log_evidence(c) for c in self._along(chosen, number)]
            average += float(log_sum(values)) - top

        for large in ("_products", "_varied"):  # a search keeps many; formed again if asked for
            self.__dict__.pop(large, None)
        return chosen, average

    def gain(self, chosen: Chosen) -> float:
        """What the evidence counts beyond where the fit stands [nats], for given sizes: of the step
        of constants and effect parameters to the optimum by linear algebra.
        """
        free = np.flatnonzero(~self._held[: int(self._ends[0])])
        mean, covariance = self._posterior(chosen, free)
        step = mean - self._centre[free]
        return float(0.5 * step @ np.linalg.solve(covariance, step))

    def constants(self, chosen: Chosen, count: int) -> tuple[Array, Array]:
        """Mean (count,) and covariance (count, count) of the first unknowns, averaged over the
        sizes about the likeliest ones.
        """
        return self.moments(chosen, np.arange(count))

    def moments(self, chosen: Chosen, wanted: Index) -> tuple[Array, Array]:
        """Mean (w,) and covariance (w, w) of the unknowns numbered `wanted` (w,), averaged
        likewise. The weights of a term are given times its size: 0 where it does not act.
        """
        ordered, weight = self._weighed(chosen)
        weighted = [
            (w, *self._posterior(c, wanted))
            for w, c in zip(weight, ordered, strict=True)
            if w > TUNING.numerics.slight_size
        ]

        total = sum(w for w, _, _ in weighted)
        mean = sum(w * m for w, m, _ in weighted) / total
        spread = sum(w * (s + np.outer(m - mean, m - mean)) for w, m, s in weighted) / total
        return np.asarray(mean), np.asarray(spread)

    def log_likelihoods(self, chosen: Chosen, number: int) -> Array:
        """Of each size of one term (n,), all others as chosen, without its prior."""
        values = [self.log_evidence(c) for c in self._along(chosen, number)]
        return np.array(values) - self.terms[number].sizes.log_prior

    def size_of(self, chosen: Chosen, number: int) -> float:
        """Root mean square size of a term, over the sizes about the likeliest ones."""
        ordered, weight = self._weighed(chosen)
        values = np.array([self.terms[number].sizes.values[c[number]] for c in ordered])
        return float(np.sqrt(weight @ values**2))

    def place_of(self, number: int) -> Index:
        """Which of the unknowns are the weights of a term (m,)."""
        return np.arange(self._ends[1 + number], self._ends[2 + number])

    def last_of_tolerance(self, count: int) -> Index:
        """Which of the unknowns are the weights of the last columns of the tolerance (count,)."""
        return np.arange(self._ends[1] - count, self._ends[1])

    def _weighed(self, chosen: Chosen) -> tuple[list[Chosen], Array]:
        """The sizes about the likeliest ones that count for what is not known, and their
        probabilities.
        """
        least = self._least(chosen)
        about = tuple(max(n, low) for n, low in zip(chosen, least, strict=True))
        every = {about, *(c for n in range(len(about)) for c in self._along(about, n))}
        ordered = sorted(c for c in every if all(n >= low for n, low in zip(c, least, strict=True)))
        values = np.array([self.log_evidence(c) for c in ordered])
        return ordered, np.asarray(np.exp(values - log_sum(values)))

    def _least(self, chosen: Chosen) -> Chosen:
        """The smallest sizes that count for what is not known. Where the equations miss one channel
        by much, no other one is right to the last digit: the soil would be bent until it seems so.
        """
        of_form = [n for n, f in zip(chosen, self.terms, strict=True) if f.kind == "form"]
        alike = max(of_form, default=0) - TUNING.fit.form_apart
        return tuple(max(f.least, alike) if f.kind == "form" else f.least for f in self.terms)

    def _posterior(self, chosen: Chosen, wanted: Index) -> tuple[Array, Array]:
        """Mean (w,) and covariance of some unknowns for given sizes, times their scale."""
        scale, acting = self._scaled(chosen)
        index = np.flatnonzero(acting & ~self._held)
        prior = self._weight[index] ** 2
        gram = self._products[np.ix_(index, index)] * scale[index, None] * scale[index]
        gram[np.diag_indices_from(gram)] += prior
        pull = self._products[index, -1] * scale[index] - prior * self._centre[index]

        root = cholesky(gram, lower=True, overwrite_a=True, check_finite=False)
        own = np.isin(wanted, index)
        units = np.zeros((len(index), int(own.sum())))
        units[np.searchsorted(index, wanted[own]), np.arange(units.shape[1])] = 1.0
        solved = solve_triangular(
            root, np.column_stack((units, pull)), lower=True, check_finite=False
        )
        inside, last = solved[:, :-1], solved[:, -1]

        mean, shared = self._centre[wanted], np.zeros((len(wanted), len(wanted)))
        mean[own] += inside.T @ last
        shared[np.ix_(own, own)] = inside.T @ inside
        sized = scale[wanted]
        return mean * sized, shared * np.outer(sized, sized)

    def _along(self, chosen: Chosen, number: int) -> list[Chosen]:
        """The same sizes but for one term, which has each of its own; with their evidence."""
        count = len(self.terms[number].sizes.values)
        if count > 1 and chosen not in self._filled[number]:
            self._fill(chosen, number)
            self._filled[number].update(
                (*chosen[:number], size, *chosen[number + 1 :]) for size in range(count)
            )
        return [(*chosen[:number], size, *chosen[number + 1 :]) for size in range(count)]

    def _fill(self, chosen: Chosen, number: int) -> None:
        """The log evidence for each size of one term, all others as chosen.

        What is not this term is eliminated once; in the eigenvectors of what remains of it, each
        of its sizes is a matter of its eigenvalues.
        """
        begin, end = int(self._ends[1 + number]), int(self._ends[2 + number])
        scale, acting = self._scaled(chosen)
        scale[begin:end] = 1.0
        acting[begin:end] = False
        rest = self._eliminated(scale, acting, np.arange(begin, end))

        values, vectors = np.linalg.eigh(rest.gram)
        values = np.maximum(values, 0.0)
        turned = vectors.T @ rest.to_strong
        pulled = vectors.T @ rest.pull
        square = np.array(self.terms[number].sizes.values)[:, None] ** 2
        share = square / (1.0 + square * values)  # (sizes, columns of the term)
        misfit = rest.misfit - share @ pulled**2
        spread = rest.spread + np.log1p(square * values).sum(axis=1)
        a = rest.strong - turned.T @ (share[:, :, None] * turned)
        b = rest.strong_pull - (share * pulled) @ turned
        strength = strength_evidence(self._strengths, a, b, rest.centre)
        for which, known in enumerate((strength - 0.5 * (misfit + spread)).tolist()):
            these = (*chosen[:number], which, *chosen[number + 1 :])
            self._known[these] = self._prior(these) + known

    def _prior(self, chosen: Chosen) -> float:
        """Log prior of given sizes."""
        pairs = zip(self.terms, chosen, strict=True)
        return float(sum(f.sizes.log_prior[i] for f, i in pairs))

    def _eliminated(self, scale: Array, acting: Bools, kept: Index) -> _Eliminated:
        """Everything that acts but the strengths eliminated, some columns kept; all by factors."""
        varied = self._varied
        acting = acting & varied.acting
        weak = np.flatnonzero(acting & ~self._strong)
        strong = np.flatnonzero(acting & self._strong)
        prior, centre = self._weight[weak] ** 2, self._centre[weak]

        beside = np.concatenate((kept, strong, [-1]))
        index = np.concatenate((weak, beside))
        columns = varied.products[np.ix_(index, beside)] * scale[index, None] * scale[beside]
        gram = varied.products[np.ix_(weak, weak)] * scale[weak, None] * scale[weak]
        gram[np.diag_indices_from(gram)] += prior
        root = cholesky(gram, lower=True, overwrite_a=True, check_finite=False)

        columns[: len(weak), -1] -= prior * centre
        inside = solve_triangular(root, columns[: len(weak)], lower=True, check_finite=False)
        own, last = inside[:, :-1], inside[:, -1]
        matrix = columns[len(weak) : -1, :-1] - own.T @ own
        right = columns[len(weak) : -1, -1] - own.T @ last

        count = len(kept)
        strain = np.sum(prior * centre**2) + self._strain_of_held()
        return _Eliminated(
            gram=matrix[:count, :count],
            to_strong=matrix[:count, count:],
            pull=right[:count],
            strong=matrix[count:, count:],
            strong_pull=right[count:],
            centre=self._centre[strong],
            misfit=float(columns[-1, -1] + strain - last @ last),
            spread=varied.spread
            + 2.0 * float(np.log(np.diag(root)).sum() - np.log(self._weight[weak]).sum()),
        )

    @cached_property
    def _products(self) -> Array:
        """Of all columns and the residual with one another."""
        return _products(self._fitted, (*self._fixed, *self.terms))

    @cached_property
    def _varied(self) -> _Varied:
        """What is left where all that has but one size is eliminated."""
        once = [True, *(len(f.sizes.values) == 1 for f in self.terms)]
        begins = zip(self._ends[:-1], self._ends[1:], once, strict=True)
        usual = np.concatenate([np.arange(a, b) for a, b, same in begins if same])
        acting = ~self._held
        acting[usual] = False

        scale, _ = self._scaled(tuple(0 for _ in self.terms))
        own = self._products[np.ix_(usual, usual)] * scale[usual, None] * scale[usual]
        own[np.diag_indices_from(own)] += 1.0
        root = cholesky(own, lower=True, overwrite_a=True, check_finite=False)
        beside = scale[usual, None] * self._products[usual]
        inside = solve_triangular(root, beside, lower=True, check_finite=False)
        spread = 2.0 * float(np.log(np.diag(root)).sum())
        return _Varied(self._products - inside.T @ inside, spread, acting)

    def _log_evidence(self, chosen: Chosen) -> float:
        scale, acting = self._scaled(chosen)
        none = np.zeros(0, dtype=np.intp)
        rest = self._eliminated(scale, acting, none)
        strength = strength_evidence(self._strengths, rest.strong, rest.strong_pull, rest.centre)
        return self._prior(chosen) + float(strength) - 0.5 * (rest.misfit + rest.spread)

    def _scaled(self, chosen: Chosen) -> tuple[Array, Bools]:
        """Factors of all columns and the residual; which columns act."""
        scale, acting = np.ones(len(self._centre) + 1), np.ones(len(self._centre), bool)
        for term, number, first, last in zip(
            self.terms, chosen, self._ends[1:-1], self._ends[2:], strict=True
        ):
            scale[first:last] = term.sizes.values[number]
            acting[first:last] = term.sizes.values[number] > 0.0
        return scale, acting

    def _strain_of_held(self) -> float:
        held = self._held & ~self._strong
        return float(np.sum((self._weight[held] * self._centre[held]) ** 2))


def _products(fitted: Fitted, terms: Sequence[RandomEffect]) -> Array:
    """Of the derivatives, the columns of all terms, and the residual with one another."""
    own = np.column_stack((fitted.own, fitted.residual))
    beside = np.concatenate([f.whitened.pulled(own) for f in terms])
    square = own.T @ own
    return np.block(
        [
            [square[:-1, :-1], beside[:, :-1].T, square[:-1, -1:]],
            [beside[:, :-1], products(terms), beside[:, -1:]],
            [square[-1:, :-1], beside[:, -1:].T, square[-1:, -1:]],
        ]
    )


def strength_evidence(strengths: Sequence[Free], a: Array, b: Array, at: Array) -> Array:
    """What strengths add to the log evidence (…), from curvature (…, p, p) and slope (…, p) of the
    likelihood where they stand (p,).
    """
    if not at.size:
        return np.zeros(b.shape[:-1])

    sign = [int(f.parameter.low >= f.parameter.off) for f in strengths]
    names = [f.name for f in strengths]
    groups = [[i for i, n in enumerate(names) if n == name] for name in dict.fromkeys(names)]
    chosen = [
        sorted(i for part in parts for i in part) for parts in product(*map(_choices, groups))
    ]

    pull = b + a @ at  # seen from strengths of nought
    factors = [
        log_bayes(a[..., np.array(s)[:, None], s], pull[..., s], [sign[i] for i in s])
        for s in chosen
    ]
    return np.asarray(log_sum(factors) - np.log(len(factors)) - b @ at - 0.5 * at @ a @ at)


def _choices(strengths: list[int]) -> list[list[int]]:
    """All strengths of an effect together, and each alone."""
    return [strengths] if len(strengths) == 1 else [strengths, *([i] for i in strengths)]
