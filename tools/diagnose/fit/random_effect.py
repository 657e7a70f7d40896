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


def products(parts: Sequence[RandomEffect]) -> Array:
    """WᵀW (m, m) of the whitened columns of terms side by side; of any two formed once, since
    hundreds of fits share them.
    """
    if not parts:
        return np.zeros((0, 0))
    rows = [
        [_between(a, b) if i <= j else _between(b, a).T for j, b in enumerate(parts)]
        for i, a in enumerate(parts)
    ]
    return np.block(rows)


_formed: WeakKeyDictionary[RandomEffect, WeakKeyDictionary[RandomEffect, Array]] = (
    WeakKeyDictionary()
)


def _between(a: RandomEffect, b: RandomEffect) -> Array:
    known = _formed.setdefault(a, WeakKeyDictionary())
    if b not in known:
        known[b] = a.whitened.gram if a is b else a.whitened.products(b.whitened)
    return known[b]
