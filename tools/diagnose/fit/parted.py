"""Products of columns, in two parts: terms that act on values of their own, and all else.

The discrepancies of form are most of a fit's columns, and each acts on one channel. So their
products with one another are nought, and each is eliminated for itself, for any of its sizes s, in
the eigenvectors V of its own products WᵀW = V Λ Vᵀ:

    G_left = G − Σ Bᵀ diag[s²/(1 + s²Λ)] B,   B = VᵀWᵀ[R r],   ln det = Σ ln(1 + s²Λ)

with all else R, whose products with itself and with the residual r are G.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.random_effect import RandomEffect, between, products


def apart(terms: Sequence[RandomEffect]) -> list[int]:
    """Which of some terms act on values of their own: no two of these on the same."""
    found: list[int] = []
    for number, term in enumerate(terms):
        if len(term.sizes.values) > 1 and not any(_meet(term, terms[n]) for n in found):
            found.append(number)
    return found


def _meet(one: RandomEffect, other: RandomEffect) -> bool:
    return any(
        a.start < b.stop and b.start < a.stop
        for a, _ in one.whitened.blocks
        for b, _ in other.whitened.blocks
    )


@dataclass(frozen=True, eq=False)
class Apart:
    """A term for a size of 1: eigenvalues (m,) and eigenvectors (m, m) of its products; beside
    (m, r): products with all else, in the eigenvectors.
    """

    term: RandomEffect
    values: Array
    vectors: Array
    beside: Array

    def share(self, size: float) -> Array:
        """s²/(1 + s²Λ) (m,)."""
        return np.asarray(size**2 / (1.0 + size**2 * self.values))

    def turned(self, columns: Array) -> Array:
        """Products (m, k) with whitened columns (N, k), in the eigenvectors."""
        return np.asarray(self.vectors.T @ self.term.whitened.pulled(columns))


class Left(NamedTuple):
    """Of given sizes: what is left of the products (r + 1, r + 1), each column times its factor
    (r + 1,), the residual last; and the ln det of what is eliminated.
    """

    products: Array
    factor: Array
    spread: float


class Parted:
    """Products of whitened columns R (N, r) and a residual. apart: the terms that act on values of
    their own, by their numbers among all; rest: the terms in R, after its own columns.
    """

    def __init__(
        self,
        own: Array,
        fixed: Sequence[RandomEffect],
        terms: Sequence[RandomEffect],
        residual: Array,
    ) -> None:
        """own (N, k): whitened, the first of R; fixed: terms of one size, the next; terms: of any
        size; residual (N,): whitened.
        """
        numbers = apart(terms)
        self.rest = (*fixed, *(f for n, f in enumerate(terms) if n not in numbers))
        self._terms, self._once = tuple(terms), own.shape[1] + sum(f.columns.count for f in fixed)

        leading = np.column_stack((own, residual))
        square = leading.T @ leading
        pulled = [f.whitened.pulled(leading) for f in self.rest]
        beside = np.vstack([np.zeros((0, leading.shape[1])), *pulled])
        self._square = np.block(
            [
                [square[:-1, :-1], beside[:, :-1].T, square[:-1, -1:]],
                [beside[:, :-1], products(self.rest), beside[:, -1:]],
                [square[-1:, :-1], beside[:, -1:].T, square[-1:, -1:]],
            ]
        )
        self.apart = {n: _part(terms[n], leading, self.rest) for n in numbers}
        self._taken: dict[tuple[int, float], Array] = {}

    def sizes(self, chosen: Sequence[int]) -> list[float]:
        """Of every term, by the number of its size."""
        return [f.sizes.values[n] for f, n in zip(self._terms, chosen, strict=True)]

    def left(self, chosen: Sequence[int]) -> Left:
        """What is left of the products for given sizes."""
        left, spread, sizes = self._square.copy(), 0.0, self.sizes(chosen)
        of_rest = [np.ones(self._once)]
        for number, (term, size) in enumerate(zip(self._terms, sizes, strict=True)):
            if number not in self.apart:
                of_rest.append(np.full(term.columns.count, size))
            elif size > 0.0:
                left -= self._of(number, size)
                spread += float(np.log1p(size**2 * self.apart[number].values).sum())
        factor = np.concatenate((*of_rest, [1.0]))
        return Left(left * factor[:, None] * factor, factor, spread)

    def _of(self, number: int, size: float) -> Array:
        """What a term takes of the products (r + 1, r + 1)."""
        if (number, size) not in self._taken:
            part = self.apart[number]
            root = np.sqrt(part.share(size))[:, None] * part.beside
            self._taken[number, size] = root.T @ root
        return self._taken[number, size]


def _part(term: RandomEffect, leading: Array, rest: Sequence[RandomEffect]) -> Apart:
    values, vectors = _eigen(term)
    pulled = term.whitened.pulled(leading)
    parts = [pulled[:, :-1], *(between(term, other) for other in rest), pulled[:, -1:]]
    return Apart(term, values, vectors, vectors.T @ np.hstack(parts))


_known: WeakKeyDictionary[RandomEffect, tuple[Array, Array]] = WeakKeyDictionary()


def _eigen(term: RandomEffect) -> tuple[Array, Array]:
    """Eigenvalues (m,) and eigenvectors (m, m) of a term's products; found once."""
    if term not in _known:
        values, vectors = np.linalg.eigh(between(term, term))
        _known[term] = np.maximum(values, 0.0), vectors
    return _known[term]
