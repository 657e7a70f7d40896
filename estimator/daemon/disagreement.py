"""While the wheel still turns: that model and measurement disagree, in which channel, and since
when.

The filter raises Flag.MISMATCH where its innovations are larger than their stated size for seconds.
After a reset of the covariance the figure starts anew, so a disagreement ends only when the flag
has been down for a while.
"""

from __future__ import annotations

import time
from math import exp, hypot, isfinite, sqrt
from typing import NamedTuple

from gritd.estimator.filter.measurement import COMPONENTS
from gritd.estimator.messages.status import Flag
from gritd.estimator.messages.tick import TICK_NAMES

NS = 1e-9
MEMORY = 2.0  # [s] over which a channel's normalised error is averaged
OVER = 5.0  # [s] without the flag end a disagreement
PLACE = {name: at for at, name in enumerate(TICK_NAMES)}


class Disagreement(NamedTuple):
    """channel: the one that is farthest off; since: [s since the epoch]; sigmas: r.m.s. of measured
    less predicted.
    """

    channel: str
    since: float
    sigmas: float


class Watch:
    """Follows the ticks, in order, as often as it is asked to."""

    def __init__(self) -> None:
        self.present: Disagreement | None = None
        self._squares = dict.fromkeys(COMPONENTS, 1.0)
        self._at, self._flagged = 0.0, 0.0

    def look(self, tick: tuple[float, ...]) -> str:
        """A line to say where a disagreement begins or ends, else ''."""
        now = float(tick[PLACE["evaluated"]]) * NS
        self._average(tick, now)
        if int(tick[PLACE["flags"]]) & Flag.MISMATCH:
            self._flagged = now
            return self._goes_on(now)
        if self.present is None or now - self._flagged < OVER:
            return ""
        since, self.present = self.present.since, None
        return f"model and measurement agree again, after {now - since:.0f} s"

    def _average(self, tick: tuple[float, ...], now: float) -> None:
        """Take up how far each channel is from what the estimate predicts."""
        keep = exp(-max(now - self._at, 0.0) / MEMORY) if self._at else 0.0
        self._at = now
        for name, before in self._squares.items():
            off = float(tick[PLACE[name]] - tick[PLACE[f"{name}_predicted"]])
            sigma = hypot(tick[PLACE[f"{name}_sigma"]], tick[PLACE[f"{name}_predicted_sigma"]])
            if isfinite(off) and isfinite(sigma) and sigma > 0.0:
                self._squares[name] = keep * before + (1.0 - keep) * (off / sigma) ** 2

    def _goes_on(self, now: float) -> str:
        channel = max(self._squares, key=lambda name: self._squares[name])
        begins, since = self.present is None, now if self.present is None else self.present.since
        self.present = Disagreement(channel, since, sqrt(self._squares[channel]))
        if not begins:
            return ""
        when = time.strftime("%H:%M:%S", time.gmtime(since))
        off = f"{self.present.sigmas:.1f} σ off"
        return f"model and measurement disagree since {when} UTC: {channel.replace('_', ' ')} {off}"
