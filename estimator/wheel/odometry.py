"""Slip over several windows: the slope of both encoders over the whole of them.

A slope over a time span has an error that falls with the span to the power of 3/2; the mean of the
slopes of n windows within it has n times that error. So consecutive windows are one regression:
what lies within the windows, their own slopes, and what lies between them, the mean positions, are
summed up (the sums of squares of an analysis of covariance). Windows that do not follow each other
have their slopes in common, and nothing in between.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from gritd.estimator.messages.readings import NS


class Odometry(NamedTuple):
    """The sums of so many windows; `piece` is the last of their consecutive ones."""

    windows: int
    at: int  # centre of the first window [ns]
    length: float  # of a window [s]
    piece: int  # windows of the last piece
    time: float  # [s] mean of the piece, since `at`
    rim: float  # [m] mean of the rim's way rωt in the piece
    travel: float  # [m] and of the travel vt
    spread: float  # [s²] Σ(t − t̄)² over pieces, a reading a second
    within: float  # [s²] of it, that within the windows
    by_rim: float  # [s m] Σ(t − t̄)(rωt − mean)
    by_travel: float  # [s m]
    undone: tuple[float, float]  # [m/s] mean of what effects take from both speeds

    @property
    def speeds(self) -> tuple[float, float]:
        """rω and v [m/s], effects accounted for."""
        rim, travel = self.undone
        return self.by_rim / self.spread + rim, self.by_travel / self.spread + travel

    @property
    def narrowing(self) -> float:
        """σ of a speed over that of the mean of the windows' speeds, 0 … 1."""
        return sqrt(self.within / self.spread)

    def joined(self, after: Odometry) -> Odometry:
        """These windows and later ones."""
        both = self.windows + after.windows
        share = after.windows / both
        sums = [a + b for a, b in zip(self[7:11], after[7:11], strict=True)]
        undone = tuple(
            [a + (b - a) * share for a, b in zip(self.undone, after.undone, strict=True)]
        )
        moved = (after.at - self.at) / NS
        gap = moved + after.time - self.time  # [s] between the means
        if not self._consecutive(after, gap):
            piece = (after.piece, moved + after.time, after.rim, after.travel)
            return Odometry(both, self.at, self.length, *piece, *sums, undone)

        piece = self.piece + after.piece
        weight = self.length * self.piece * after.piece / piece
        rim, travel = after.rim - self.rim, after.travel - self.travel
        between = (weight * gap * gap, 0.0, weight * gap * rim, weight * gap * travel)
        sums = [a + b for a, b in zip(sums, between, strict=True)]
        share = after.piece / piece
        means = (self.time + gap * share, self.rim + rim * share, self.travel + travel * share)
        return Odometry(both, self.at, self.length, piece, *means, *sums, undone)

    def _consecutive(self, after: Odometry, gap: float) -> bool:
        """Whether the later windows are one piece, and go on where this one's last ends."""
        if after.piece != after.windows or after.length != self.length:
            return False
        return abs(gap / self.length - 0.5 * (self.piece + after.piece)) < 0.5


def of_window(
    at: int,
    length: float,
    ways: tuple[float, float],
    speeds: tuple[float, float],
    undone: tuple[float, float],
) -> Odometry:
    """One window of so many seconds about `at` [ns]: way of rim and carriage [m], their speeds as
    read [m/s], and what effects take from these.
    """
    within = length**3 / 12.0
    rim, travel = speeds
    return Odometry(
        1, at, length, 1, 0.0, *ways, within, within, rim * within, travel * within, undone
    )
