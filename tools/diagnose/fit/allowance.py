"""What a fit may be off by beside constants and effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.terramechanics.soil import Array


@dataclass(frozen=True, eq=False)
class Allowance:
    """What a fit may be off by beside constants and effects: columns of unit normal weights.

    They are many, and most are shared between fits: so they are put together when asked for.
    parts: columns (N, m) in the channels' units, the same whitened, and their size; fixed: how many
    parts every fit has. Those after them are freedoms, which are predicted elsewhere too.
    """

    parts: tuple[tuple[Array, Array, float], ...]
    fixed: int

    def with_parts(self, more: Sequence[tuple[Array, Array, float]]) -> Allowance:
        """With more columns (N, m), the same whitened, and their size."""
        return replace(self, parts=(*self.parts, *more))

    def without_size(self) -> Allowance:
        """The same columns, all nought."""
        return replace(self, parts=tuple((c, w, 0.0) for c, w, _ in self.parts))

    @property
    def columns(self) -> Array:
        """(N, t) in the channels' units."""
        return np.column_stack([size * columns for columns, _, size in self.parts])

    @property
    def whitened(self) -> Array:
        """(N, t)."""
        return np.column_stack([size * whitened for _, whitened, size in self.parts])

    @property
    def carried(self) -> Array:
        """(N, m) in the channels' units: those that are predicted elsewhere too."""
        none = self.parts[0][0][:, :0]
        return np.column_stack(
            [none, *(size * columns for columns, _, size in self.parts[self.fixed :])]
        )
