"""Columns of which most act on a part of the values: on one channel, or on one channel of a run.

Hundreds of columns stand for what a fit may be off by. A product of two of them is a matter of the
values on which both act.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.noise.colour import Noise
from gritd.tools.diagnose.rig.interface import Bools


@dataclass(frozen=True, eq=False)
class Columns:
    """(N, m): blocks side by side, each of columns (n, k) that act on consecutive values."""

    size: int
    blocks: tuple[tuple[slice, Array], ...] = ()

    @property
    def count(self) -> int:
        """m."""
        return sum(own.shape[1] for _, own in self.blocks)

    @property
    def dense(self) -> Array:
        """(N, m) with its zeros."""
        out = np.zeros((self.size, self.count))
        for (rows, own), place in zip(self.blocks, self._places, strict=True):
            out[rows, place] = own
        return out

    @property
    def _places(self) -> Iterator[slice]:
        """Of each block among the columns."""
        end = 0
        for _, own in self.blocks:
            yield slice(end, end + own.shape[1])
            end += own.shape[1]

    def scaled(self, size: float | Array) -> Columns:
        """Times one size, or one for each column (m,)."""
        sizes = np.broadcast_to(size, self.count)
        places = zip(self.blocks, self._places, strict=True)
        return replace(
            self, blocks=tuple((rows, own * sizes[place]) for (rows, own), place in places)
        )

    def of_rows(self, marked: Bools) -> Columns:
        """Nought but on the marked values (N,)."""
        blocks = [(rows, np.where(marked[rows, None], own, 0.0)) for rows, own in self.blocks]
        return replace(self, blocks=tuple(blocks))

    def among(self, marked: Bools) -> Columns:
        """On the marked values (N,) alone, one after the other."""
        before = np.concatenate(([0], np.cumsum(marked)))
        blocks = tuple(
            (slice(int(before[rows.start]), int(before[rows.stop])), own[marked[rows]])
            for rows, own in self.blocks
        )
        return Columns(int(before[-1]), blocks)

    def times(self, weights: Array) -> Array:
        """What weights (m,) amount to (N,)."""
        out = np.zeros(self.size)
        for (rows, own), place in zip(self.blocks, self._places, strict=True):
            out[rows] += own @ weights[place]
        return out

    def pulled(self, values: Array, begin: int = 0) -> Array:
        """Products (m, …) with values (n, …), of which the first stands at `begin` among all N."""
        end = begin + len(values)
        parts = [np.zeros((0, *values.shape[1:]))]
        for rows, own in self.blocks:
            low, high = max(rows.start, begin), min(rows.stop, end)
            inside = own[max(low - rows.start, 0) : max(high - rows.start, 0)]
            parts.append(inside.T @ values[max(low - begin, 0) : max(high - begin, 0)])
        return np.concatenate(parts)

    def products(self, other: Columns) -> Array:
        """(m, k) with other columns (N, k)."""
        parts = [np.zeros((self.count, 0))]
        return np.hstack([*parts, *(self.pulled(own, rows.start) for rows, own in other.blocks)])

    @property
    def gram(self) -> Array:
        """Products (m, m) with one another."""
        out = np.zeros((self.count, self.count))
        for number, place in enumerate(self._places):
            rows, own = self.blocks[number]
            before = replace(self, blocks=self.blocks[: number + 1]).pulled(own, rows.start)
            out[: place.stop, place] = before
            out[place, : place.stop] = before.T
        return out


def joined(size: int, parts: Sequence[Columns]) -> Columns:
    """Columns of several kinds side by side; size: N."""
    return Columns(size, tuple(block for part in parts for block in part.blocks))


def whole(columns: Array) -> Columns:
    """Columns (N, m) that act anywhere."""
    return Columns(len(columns), ((slice(0, len(columns)), columns),))


def columns_of(columns: Array) -> Columns:
    """Columns (N, m) in blocks of neighbours that act on the same values."""
    acting = columns != 0.0
    first = np.argmax(acting, axis=0)
    end = np.where(acting.any(axis=0), len(columns) - np.argmax(acting[::-1], axis=0), first)
    extents = np.column_stack((first, end))
    begins = np.flatnonzero(np.any(np.diff(extents, axis=0, prepend=-1), axis=1))

    blocks = []
    for place, own in zip(begins, np.split(columns, begins[1:], axis=1), strict=False):
        rows = slice(*extents[place].tolist())
        blocks.append((rows, np.ascontiguousarray(own[rows])))
    return Columns(len(columns), tuple(blocks))


def whitened(noise: Noise, columns: Columns) -> Columns:
    """In units of independent unit noise."""
    blocks = []
    for rows, own in columns.blocks:
        if rows.stop > rows.start:
            touched = noise.touched(rows.start, rows.stop)
            blocks.append((touched, np.asarray(noise.whitener[touched, rows] @ own)))
        else:
            blocks.append((rows, own))
    return replace(columns, blocks=tuple(blocks))
