"""While the wheel still turns: that model and measurement disagree, in which channel, and since
when; that the soil changed; that the filter's estimate is not believed, and why.

The filter raises Flag.MISMATCH where its innovations are larger than their stated size for seconds.
After a reset of the covariance the figure starts anew, so a disagreement ends only when the flag
has been down for a while.
"""

from __future__ import annotations

import time
from math import exp, hypot, isfinite, sqrt
from typing import NamedTuple

from gritd.estimator.daemon.notice import Notice
from gritd.estimator.filter.measurement import COMPONENTS
from gritd.estimator.messages.status import Flag, Status
from gritd.estimator.messages.tick import TICK_NAMES

NS = 1e-9
MEMORY = 2.0  # [s] over which a channel's normalised error is averaged
OVER = 5.0  # [s] without the flag end a disagreement
PLACE = {name: at for at, name in enumerate(TICK_NAMES)}
OFF = {Flag.TORQUE_OFF: "torque", Flag.DRAWBAR_PULL_OFF: "drawbar_pull"}
DOUBTED = {
    Status.AT_BOUND: "it stands at a bound that the prior calls improbable",
    Status.DIVERGED: "σ was set back again and again, or is wider than the prior's",
    Status.MISMATCH: "neither one soil nor a change of it explains what is measured",
}


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
        self._changed = False  # whether the last tick said that the soil changed
        self._doubted: float | None = None  # since when the estimate is not believed

    def look(self, tick: tuple[float, ...]) -> tuple[Notice, ...]:
        """What begins or ends."""
        now, flags = float(tick[PLACE["evaluated"]]) * NS, int(tick[PLACE["flags"]])
        self._average(tick, now)
        notices = (
            self._change(flags),
            self._disagreement(flags, now),
            self._doubt(flags, int(tick[PLACE["status"]]), now),
        )
        return tuple(notice for notice in notices if notice is not None)

    def _change(self, flags: int) -> Notice | None:
        before, self._changed = self._changed, bool(flags & Flag.CHANGED)
        if before or not self._changed:
            return None
        return Notice("the soil changed: σ of c and tan φ is widened")

    def _doubt(self, flags: int, status: int, now: float) -> Notice | None:
        if not flags & Flag.PRIOR:
            since, self._doubted = self._doubted, None
            if since is None:
                return None
            text = f"the filter's estimate is believed again, after {now - since:.0f} s"
            return Notice(text, over=True)
        if self._doubted is not None or status not in DOUBTED:
            return None

        self._doubted = now
        reason = DOUBTED[Status(status)]
        return Notice(f"the filter's estimate is not believed, c and tan φ are the prior: {reason}")

    def _disagreement(self, flags: int, now: float) -> Notice | None:
        if flags & Flag.MISMATCH:
            self._flagged = now
            return self._goes_on(flags, now)
        if self.present is None or now - self._flagged < OVER:
            return None

        since, self.present = self.present.since, None
        return Notice(f"model and measurement agree again, after {now - since:.0f} s", over=True)

    def _average(self, tick: tuple[float, ...], now: float) -> None:
        """Take up how far each channel is from what the estimate predicts."""
        keep = exp(-max(now - self._at, 0.0) / MEMORY) if self._at else 0.0
        self._at = now
        for name, before in self._squares.items():
            off = float(tick[PLACE[name]] - tick[PLACE[f"{name}_predicted"]])
            sigma = hypot(tick[PLACE[f"{name}_sigma"]], tick[PLACE[f"{name}_predicted_sigma"]])
            if isfinite(off) and isfinite(sigma) and sigma > 0.0:
                self._squares[name] = keep * before + (1.0 - keep) * (off / sigma) ** 2

    def _goes_on(self, flags: int, now: float) -> Notice | None:
        channel = next(name for flag, name in OFF.items() if flags & flag)
        begins, since = self.present is None, now if self.present is None else self.present.since
        self.present = Disagreement(channel, since, sqrt(self._squares[channel]))
        if not begins:
            return None

        when = time.strftime("%H:%M:%S", time.gmtime(since))
        off = f"{channel.replace('_', ' ')} {self.present.sigmas:.1f} σ off"
        return Notice(f"model and measurement disagree since {when} UTC: {off}")
