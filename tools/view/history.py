"""The last hour of reports, kept by the view: the daemon keeps none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gritd.estimator.terramechanics.soil import Array

RATE = 10  # [Hz] reports come at most so often
LONGEST = 3600.0  # [s]


class History:
    """A ring of rows: time [s], and the fields as float32."""

    def __init__(self, fields: Sequence[str], rows: int = round(RATE * LONGEST * 1.05)) -> None:
        self.fields = tuple(fields)
        self._time = np.zeros(rows)
        self._values = np.full((rows, len(self.fields)), np.nan, np.float32)
        self._next = self._used = 0
        self.last = -np.inf

    def add(self, time: float, values: Mapping[str, Any]) -> bool:
        """A row, unless it is not later than the one before."""
        if not time > self.last:
            return False
        self._put(time, [_number(values.get(name)) for name in self.fields])
        return True

    def interrupt(self) -> None:
        """Lines end here: what comes next does not connect with what was."""
        if self._used:
            self._put(float(np.nextafter(self.last, np.inf)), [np.nan] * len(self.fields))

    def begin_anew(self) -> None:
        """Forget all: time has gone back."""
        self._next = self._used = 0
        self.last = -np.inf

    def rows(self, since: float = -np.inf) -> tuple[Array, Array]:
        """Times (n,) and values (n, m) in the order of time, from one row before `since` on."""
        order = np.arange(self._next - self._used, self._next) % len(self._time)
        time = self._time[order]
        kept = order[max(int(np.searchsorted(time, since)) - 1, 0) :]
        return self._time[kept], self._values[kept].astype(float)

    def _put(self, time: float, row: Sequence[float]) -> None:
        self._time[self._next], self._values[self._next] = time, row
        self._next = (self._next + 1) % len(self._time)
        self._used = min(self._used + 1, len(self._time))
        self.last = time


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else np.nan
