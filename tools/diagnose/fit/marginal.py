"""The evidence of a fit, averaged over the sizes of its terms.

Around its optimum a fit is linear in all its unknowns, so for any sizes of the terms the
evidence is a matter of the products of the columns, which are formed once:

    ln Z(s) = −½ (rᵀr + |strain|² − bᵀA⁻¹b + ln det A − ln det P),   A = CᵀC + P

with the columns C (Jacobian, tolerance, terms times their sizes), their prior precisions P and
b = Cᵀr − P centre (Laplace's approximation: MacKay 2003, ch. 27). The strengths of effects have the
screen's prior: several sizes, and of each effect all strengths or one alone. A parameter that
stands at its bound is held there: it keeps the density of its prior and has no width of its own.
Terms that act on values of their own are eliminated first (parted.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import product

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import log_bayes, log_sum
from gritd.tools.diagnose.fit.parted import Parted, apart
from gritd.tools.diagnose.fit.problem import Fitted, Free
from gritd.tools.diagnose.fit.random_effect import RandomEffect
from gritd.tools.diagnose.rig.interface import Index
from gritd.tools.diagnose.tuning import TUNING

Chosen = tuple[int, ...]  # of each term, which of its sizes


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

        numbers = set(range(len(self.terms))) - set(apart(self.terms))
        beside = [self.place_of(n) for n in sorted(numbers)]
        self._rest = np.concatenate((np.arange(known + allowed), *beside))
        centre, weight = np.concatenate((fitted.u, fitted.x)), fitted.penalty[:known]
        more = len(self._rest) - known
        self._centre = np.concatenate((centre, np.zeros(more)))
        self._weight = np.concatenate((weight, np.ones(more)))
        self._held = np.concatenate((fitted.held, np.zeros(more, bool)))

        first, own = len(fitted.u), zip(fitted.free, fitted.held[len(fitted.u) :], strict=True)
        self._strong = np.zeros(len(self._rest), bool)
        self._strong[first:known] = [f.parameter.role == "strength" for f in fitted.free]
        self._strengths = [f for f, held in own if f.parameter.role == "strength" and not held]
        self._evidence: dict[Chosen, float] = {}

    def beside(self, terms: Sequence[RandomEffect]) -> Marginal:
        """The same fit with further terms."""
        return Marginal(self._fitted, self._fixed, (*self.terms, *terms))

    def log_evidence(self, chosen: Chosen) -> float:
        """For given sizes, their prior counted."""
        self._weigh([chosen])
        return self._evidence[chosen]

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

        self.__dict__.pop("_parted", None)  # a search keeps many; formed again if asked for
        return chosen, average

    def gain(self, chosen: Chosen) -> float:
        """What the evidence counts beyond where the fit stands [nats], for given sizes: of the step
        of constants and effect parameters to the optimum by linear algebra.
        """
        free = np.flatnonzero(~self._fitted.held)
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
        matrix, factor, _ = self._parted.left(chosen)
        scale = factor[:-1]
        index = np.flatnonzero((scale > 0.0) & ~self._held)
        root, last = self._rooted(matrix, index)
        inside = solve_triangular(root, np.eye(len(index)), lower=True, check_finite=False)

        # mean and slope along what is left, of those in it
        every = np.zeros(self._ends[-1])
        every[self._rest] = self._centre * scale
        mean, shared = every[wanted], np.zeros((len(wanted), len(wanted)))
        linear = np.where(wanted[:, None] == self._rest[index], scale[index], 0.0)

        sizes = self._parted.sizes(chosen)
        for number, part in self._parted.apart.items():
            size, first = sizes[number], int(self._ends[1 + number])
            those = np.flatnonzero((wanted >= first) & (wanted < self._ends[2 + number]))
            if size > 0.0 and those.size:
                turned = part.vectors[wanted[those] - first] * part.share(size)
                mean[those] += turned @ part.beside[:, -1]
                linear[those] -= turned @ part.beside[:, index] * scale[index]
                shared[np.ix_(those, those)] += turned @ part.vectors[wanted[those] - first].T

        turned = linear @ inside.T
        return mean + turned @ last, shared + turned @ turned.T

    def _along(self, chosen: Chosen, number: int) -> list[Chosen]:
        """The same sizes but for one term, which has each of its own; with their evidence."""
        count = len(self.terms[number].sizes.values)
        every = [(*chosen[:number], size, *chosen[number + 1 :]) for size in range(count)]
        self._weigh(every)
        return every

    def _weigh(self, some: Sequence[Chosen]) -> None:
        """Makes the log evidence for some sizes known."""
        new = [chosen for chosen in some if chosen not in self._evidence]
        if not new:
            return
        made = [self._without_weak(chosen) for chosen in new]
        a, b, known = (np.array(each) for each in zip(*made, strict=True))
        at = self._centre[self._strong & ~self._held]
        values = known + strength_evidence(self._strengths, a, b, at)
        for chosen, value in zip(new, values.tolist(), strict=True):
            pairs = zip(self.terms, chosen, strict=True)
            prior = float(sum(f.sizes.log_prior[i] for f, i in pairs))
            self._evidence[chosen] = prior + value

    def _without_weak(self, chosen: Chosen) -> tuple[Array, Array, float]:
        """Curvature (p, p) and slope (p,) of the strengths, all else eliminated, and the log
        evidence where these stand [nats]; by factors.
        """
        matrix, factor, spread = self._parted.left(chosen)
        acting = factor[:-1] > 0.0
        weak = np.flatnonzero(acting & ~self._held & ~self._strong)
        strong = np.flatnonzero(acting & ~self._held & self._strong)
        centre, prior = self._centre[weak], self._weight[weak] ** 2
        root, last = self._rooted(matrix, weak)

        inside = solve_triangular(
            root, matrix[np.ix_(weak, strong)], lower=True, check_finite=False
        )
        held = self._held & ~self._strong
        strain = prior @ centre**2 + np.sum((self._weight[held] * self._centre[held]) ** 2)
        misfit = matrix[-1, -1] + strain - last @ last
        spread += 2.0 * float(np.log(np.diag(root)).sum() - np.log(self._weight[weak]).sum())
        return (
            matrix[np.ix_(strong, strong)] - inside.T @ inside,
            matrix[strong, -1] - inside.T @ last,
            -0.5 * float(misfit + spread),
        )

    def _rooted(self, matrix: Array, index: Index) -> tuple[Array, Array]:
        """Cholesky root (n, n) of the products of some unknowns with their prior, and L⁻¹b (n,)."""
        prior = self._weight[index] ** 2
        gram = matrix[np.ix_(index, index)]
        gram[np.diag_indices_from(gram)] += prior
        root = cholesky(gram, lower=True, overwrite_a=True, check_finite=False)
        pull = matrix[index, -1] - prior * self._centre[index]
        return root, solve_triangular(root, pull, lower=True, check_finite=False)

    @cached_property
    def _parted(self) -> Parted:
        return Parted(self._fitted.own, self._fixed, self.terms, self._fitted.residual)


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
