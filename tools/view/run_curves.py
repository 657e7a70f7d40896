"""The curves of one recorded run, by time and by way, at any zoom."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.recording.cdr import Rows
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.service.wording import SHOWN
from gritd.tools.view.charts import CHARTS, drawn, fields_of
from gritd.tools.view.downsample import envelope
from gritd.tools.view.rim import NEEDED

Along = Literal["time", "way"]
NS = 1e-9
BLOCK = 64  # rows whose least and greatest are kept for wide zooms
COUNTS = ("status", "flags", "stale", "stuck", "sequence", "updates", "resets")
VALUES = tuple(name for shown in SHOWN for name in (shown.value, shown.sigma))
FIELDS = tuple(
    dict.fromkeys((*fields_of(CHARTS), *VALUES, *NEEDED, *COUNTS, "separability", "cov_c_tan_phi"))
)
TICK_FIELDS = (*FIELDS, "evaluated", "carriage_position")  # what is read of a recording


@dataclass(frozen=True)
class RunCurves:
    """time: since the start of the run [s], ascending (n,); way: the farthest that the carriage
    had come from where it started [m], (n,); values: FIELDS as float32 (n, m). whole: whether
    these are all ticks; else they are some, from all over the run.
    """

    start: int  # [ns]
    time: Array
    way: Array
    values: NDArray[np.float32]
    whole: bool

    @classmethod
    def of(cls, rows: Rows, whole: bool) -> RunCurves:
        """rows: /tick (n,), one at least."""
        evaluated = np.asarray(rows["evaluated"])
        first = np.concatenate(([True], evaluated[1:] > np.maximum.accumulate(evaluated)[:-1]))
        rows = rows[first]  # an instant once, and time never goes back
        start = int(rows["evaluated"][0])
        values = np.stack([np.asarray(rows[name], np.float32) for name in FIELDS], axis=1)

        position = np.asarray(rows["carriage_position"])
        known = np.isfinite(position)
        away = np.abs(position - position[np.argmax(known)])
        way = np.maximum.accumulate(np.where(known, away, 0.0))
        return cls(start, (rows["evaluated"] - start) * NS, way, values, whole)

    @property
    def duration(self) -> float:
        """[s]"""
        return float(self.time[-1])

    def axis(self, along: Along) -> Array:
        return self.time if along == "time" else self.way

    def stretch(self, along: Along, span: tuple[float, float], points: int) -> tuple[Array, Array]:
        """Places (p,) and columns of the charts (p, m), as `envelope`."""
        axis = self.axis(along)
        begin, end = np.searchsorted(axis, span, "left")
        wide = end - begin > points * BLOCK
        if wide and self.whole:
            places, columns = self._coarse(along)
            return envelope(places, columns, span, points)

        some = slice(max(int(begin) - 1, 0), int(end) + 1)
        columns = drawn(CHARTS, FIELDS, self.values[some].astype(float))
        places, made = envelope(axis[some], columns, span, points)
        filled = slice(None) if self.whole else np.isfinite(made).any(axis=1)
        return places[filled], made[filled]

    def _coarse(self, along: Along) -> tuple[Array, Array]:
        axis = self.axis(along)
        low, high = self._extremes
        places = axis[::BLOCK]
        pairs = np.stack((low, high), axis=1).reshape(-1, low.shape[1])
        return np.repeat(places, 2), pairs

    @cached_property
    def _extremes(self) -> tuple[Array, Array]:
        """Least and greatest of each column of the charts in every BLOCK of rows, (b, m)."""
        parts = range(0, len(self.values), BLOCK * 1024)
        kept = [self._extremes_of(self.values[at : at + BLOCK * 1024]) for at in parts]
        return np.concatenate([low for low, _ in kept]), np.concatenate([high for _, high in kept])

    def _extremes_of(self, values: NDArray[np.float32]) -> tuple[Array, Array]:
        columns = drawn(CHARTS, FIELDS, values.astype(float))
        starts = np.arange(0, len(columns), BLOCK)
        return np.fmin.reduceat(columns, starts), np.fmax.reduceat(columns, starts)

    def prepared(self) -> RunCurves:
        """Itself, with what wide zooms need made."""
        assert self._extremes
        return self

    def nearest(self, along: Along, at: float) -> int:
        """The row at a place, or the one before it."""
        return max(int(np.searchsorted(self.axis(along), at, "right")) - 1, 0)

    def tick(self, row: int) -> dict[str, Any]:
        """One row by name; whole numbers as such."""
        named = dict(zip(FIELDS, self.values[row].tolist(), strict=True))
        return {k: int(v) if k in COUNTS else v for k, v in named.items()}

    def way_of_the_soil(self, along: Along, span: tuple[float, float], most: int) -> Array:
        """c [Pa] and tan φ along a span (q, 2)."""
        begin, end = np.searchsorted(self.axis(along), span)
        soil = [FIELDS.index(name) for name in ("cohesion", "tan_phi")]
        step = max(1, int(end - begin) // most)
        return np.asarray(self.values[begin:end:step, soil], float)

    def column(self, field: str) -> NDArray[np.float32]:
        return self.values[:, FIELDS.index(field)]


def changes(of: NDArray[np.float32], bit: int) -> tuple[Sequence[int], Sequence[int]]:
    """Rows at which a bit of a column of whole numbers is set, and at which it is cleared."""
    held = (of.astype(np.int64) & bit) > 0
    turns = np.flatnonzero(np.diff(held.astype(np.int8)))
    return [int(i) + 1 for i in turns if held[i + 1]], [int(i) + 1 for i in turns if held[i]]


def rises(of: NDArray[np.float32]) -> Mapping[int, int]:
    """Rows at which a count grows, and by how much."""
    grown = np.diff(of)
    return {int(i) + 1: int(grown[i]) for i in np.flatnonzero(grown > 0)}
