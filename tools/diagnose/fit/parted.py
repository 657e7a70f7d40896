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


class Parted:
    """Products of whitened columns R (N, r) and a residual. parts: the terms that act on values of
    their own; square (r + 1, r + 1): of all else with one another, the residual last.
    """

    def __init__(
        self,
        own: Array,
        rest: Sequence[RandomEffect],
        residual: Array,
        terms: Sequence[RandomEffect],
    ) -> None:
        """own (N, k): the first of R; rest: its other columns; terms: that act on values of their
        own. All whitened.
        """
        leading = np.column_stack((own, residual))
        square = leading.T @ leading
        pulled = [f.whitened.pulled(leading) for f in rest]
        beside = np.vstack([np.zeros((0, leading.shape[1])), *pulled])
        self.square = np.block(
            [
                [square[:-1, :-1], beside[:, :-1].T, square[:-1, -1:]],
                [beside[:, :-1], products(rest), beside[:, -1:]],
                [square[-1:, :-1], beside[:, -1:].T, square[-1:, -1:]],
            ]
        )
        self.parts = [_part(term, leading, rest) for term in terms]
        self._taken: dict[tuple[int, float], Array] = {}

    def left(self, sizes: Sequence[float]) -> tuple[Array, float]:
        """What is left of the products (r + 1, r + 1) for given sizes, and the ln det of what is
        eliminated.
        """
        left, spread = self.square.copy(), 0.0
        for number, (part, size) in enumerate(zip(self.parts, sizes, strict=True)):
            if size > 0.0:
                left -= self._of(number, size)
                spread += float(np.log1p(size**2 * part.values).sum())
        return left, spread

    def _of(self, number: int, size: float) -> Array:
        """What a term takes of the products (r + 1, r + 1)."""
        if (number, size) not in self._taken:
            part = self.parts[number]
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
