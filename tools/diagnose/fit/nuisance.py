"""What a fit may be off by beside constants and effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.columns import Columns, joined
from gritd.tools.diagnose.fit.random_effect import RandomEffect, products


@dataclass(frozen=True, eq=False)
class NuisanceColumns:
    """What a fit may be off by beside constants and effects: columns of unit normal weights.

    They are many, and most are shared between fits: so they are put together when asked for.
    parts: terms and the size of each. The first one every fit has; those after it are predicted
    elsewhere too.
    """

    parts: tuple[tuple[RandomEffect, float], ...]

    def with_parts(self, more: Sequence[tuple[RandomEffect, float]]) -> NuisanceColumns:
        """With more terms, each of its size."""
        return replace(self, parts=(*self.parts, *more))

    def without_size(self) -> NuisanceColumns:
        """The same columns, all nought."""
        return replace(self, parts=tuple((f, 0.0) for f, _ in self.parts))

    @property
    def count(self) -> int:
        """Columns."""
        return sum(f.columns.count for f, _ in self.parts)

    @property
    def columns(self) -> Columns:
        """(N, t) in the channels' units."""
        return joined(self._values, [f.columns.scaled(size) for f, size in self.parts])

    @property
    def whitened(self) -> Columns:
        """(N, t)."""
        return joined(self._values, [f.whitened.scaled(size) for f, size in self.parts])

    @property
    def carried(self) -> Columns:
        """(N, m) in the channels' units: those that are predicted elsewhere too."""
        return joined(self._values, [f.columns.scaled(size) for f, size in self.parts[1:]])

    @property
    def _values(self) -> int:
        """N."""
        return self.parts[0][0].columns.size

    @property
    def gram(self) -> Array:
        """Products (t, t) of the whitened columns."""
        size = np.concatenate([np.full(f.columns.count, size) for f, size in self.parts])
        return np.asarray(products([f for f, _ in self.parts]) * size[:, None] * size)

    def pulled(self, values: Array) -> Array:
        """Products (t, …) of the whitened columns with whitened values (N, …)."""
        return np.concatenate([size * f.whitened.pulled(values) for f, size in self.parts])
