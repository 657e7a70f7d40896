"""Functions that a model may be off by, of a size that the recordings tell.

A random effect, in short a term, is a set of columns with unit normal weights, times one size for
all of them. Its size has a prior over a few values. The form of the model has terms
(discrepancy.py), and so has every effect, whose published forms differ (form_error.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal
from weakref import WeakKeyDictionary

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.columns import Columns, columns_of, whitened
from gritd.tools.diagnose.noise.colour import Noise
from gritd.tools.diagnose.tuning import TUNING

Kind = Literal["", "form", "profile", "place", "law"]


@dataclass(frozen=True)
class Sizes:
    """The sizes tried, the smallest first, and the prior probability of each; one as it stands, if
    none are given.
    """

    values: tuple[float, ...] = (1.0,)
    prior: tuple[float, ...] = (1.0,)

    def up_to(self, number: int) -> Sizes:
        """Without those above the one of this number."""
        return Sizes(self.values[: number + 1], self.prior[: number + 1])

    @property
    def log_prior(self) -> Array:
        """Of each size (n,)."""
        return np.log(np.array(self.prior) / sum(self.prior))


def even(values: tuple[float, ...]) -> Sizes:
    """Sizes of which none is likelier than another."""
    return Sizes(values, tuple(1.0 for _ in values))


@dataclass(frozen=True, eq=False)
class RandomEffect:
    """Columns (N, m) for a size of 1, in the channels' units and in those of independent noise.

    least: the number of the smallest size that counts for the uncertainty of the constants.
    kind: `form` is what the equations of a wheel in soil miss of some channel; of an effect
        `profile` is how it goes along what no law tells of, `place` how it varies along the bed,
        `law` how else published forms of it differ; empty for all other.
    """

    name: str
    columns: Columns
    whitened: Columns
    sizes: Sizes
    least: int = 0
    kind: Kind = ""


def random_effect(
    name: str,
    columns: Array,
    noise: Noise,
    sizes: Sizes,
    least: int = 0,
    kind: Kind = "",
) -> RandomEffect:
    """The term of columns (N, m) in the channels' units."""
    own = columns_of(columns)
    return RandomEffect(name, own, whitened(noise, own), sizes, least, kind)


def blocks_shown(columns: Array, noise: Noise) -> Array:
    """Combinations of columns (N, m) in the channels' units, of those that act on the same values
    each; without those that the noise hides altogether.
    """
    own, least = columns_of(columns), TUNING.numerics.least_allowed
    pairs = zip(own.blocks, whitened(noise, own).blocks, strict=True)
    kept = [(rows, shown(block, white, least)) for (rows, block), (_, white) in pairs]
    return Columns(len(columns), tuple(kept)).dense


def shown(columns: Array, whitened: Array, least: float) -> Array:
    """Combinations of columns with the same covariance, the largest first; without those that
    are less than a share of the noise altogether.
    """
    if not columns.shape[1]:
        return columns
    values, vectors = np.linalg.eigh(whitened.T @ whitened)
    return np.asarray(columns @ vectors[:, np.flatnonzero(values > least)[::-1]])


def products(parts: Sequence[RandomEffect]) -> Array:
    """WᵀW (m, m) of the whitened columns of terms side by side."""
    if not parts:
        return np.zeros((0, 0))
    return np.block([[between(a, b) for b in parts] for a in parts])


_formed: WeakKeyDictionary[RandomEffect, WeakKeyDictionary[RandomEffect, Array]] = (
    WeakKeyDictionary()
)


def between(a: RandomEffect, b: RandomEffect) -> Array:
    """Products (m, k) of the whitened columns of two terms; formed once, since hundreds of fits
    share them.
    """
    known, other = (_formed.setdefault(each, WeakKeyDictionary()) for each in (a, b))
    if a in other:
        return np.asarray(other[a].T)
    if b not in known:
        known[b] = a.whitened.gram if a is b else a.whitened.products(b.whitened)
    return known[b]
