"""Slip over several windows: the slope of both encoders over the whole of them.

A slope over a time span has an error that falls with the span to the power of 3/2; the mean of the
slopes of n windows within it has n times that error. So consecutive windows are one regression:
what lies within the windows, their own slopes, and what lies between them, the mean positions, are
summed up (the sums of squares of an analysis of covariance). Windows that do not follow each other
may have been driven at another slip: then the slopes count by their windows, as torque and pull do.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from gritd.estimator.messages.readings import NS


class Piece(NamedTuple):
    """Consecutive windows: how many, and their means."""

    windows: int
    time: float  # [s] since the first window of all
    rim: float  # [m] the rim's way rωt
    travel: float  # [m] the travel vt

    def joined(self, after: Piece) -> Piece:
        """With those that follow."""
        windows = self.windows + after.windows
        share = after.windows / windows
        return Piece(
            windows,
            self.time + (after.time - self.time) * share,
            self.rim + (after.rim - self.rim) * share,
            self.travel + (after.travel - self.travel) * share,
        )


class Sums(NamedTuple):
    """Squares and products about the means of a piece, a reading a second."""

    spread: float  # [s²] of t
    by_rim: float  # [s m] of t and the rim's way
    by_travel: float  # [s m] of t and the travel

    def plus(self, other: Sums) -> Sums:
        """Of both."""
        return Sums(
            self.spread + other.spread,
            self.by_rim + other.by_rim,
            self.by_travel + other.by_travel,
        )


class Past(NamedTuple):
    """Sums over the pieces before the last, each by its windows."""

    rim: float = 0.0  # [m/s] of the slopes
    travel: float = 0.0  # [m/s]
    variance: float = 0.0  # [1/s²] of the slopes, for readings of unit noise

    def plus(self, other: Past) -> Past:
        """Of both."""
        return Past(
            self.rim + other.rim, self.travel + other.travel, self.variance + other.variance
        )


class Odometry(NamedTuple):
    """What the encoders say of so many windows."""

    windows: int
    at: int  # centre of the first window [ns]
    length: float  # of a window [s]
    piece: Piece  # the last one
    sums: Sums  # of the last piece
    past: Past
    undone: tuple[float, float]  # [m/s] mean of what effects add to both speeds

    @property
    def slopes(self) -> tuple[float, float, float]:
        """rω and v [m/s], effects accounted for, and σ of each over that of the mean of the
        windows' speeds, 0 … 1.
        """
        whole, (rim, travel) = self._whole, self.undone
        return (
            whole.rim / self.windows + rim,
            whole.travel / self.windows + travel,
            sqrt(self.length**3 / 12.0 * whole.variance / self.windows),
        )

    @property
    def _whole(self) -> Past:
        """Over all pieces."""
        windows, sums = self.piece.windows, self.sums
        weight = windows / sums.spread
        last = Past(weight * sums.by_rim, weight * sums.by_travel, windows * weight)
        return self.past.plus(last)

    def joined(self, after: Odometry) -> Odometry:
        """These windows and later ones."""
        windows = self.windows + after.windows
        share = after.windows / windows
        (rim, travel), (rim_after, travel_after) = self.undone, after.undone
        undone = (rim + (rim_after - rim) * share, travel + (travel_after - travel) * share)

        last, moved = after.piece, (after.at - self.at) / NS
        last = last._replace(time=last.time + moved)
        if self._followed_by(last, after):
            sums = self.sums.plus(after.sums).plus(self._between(last))
            last, past = self.piece.joined(last), self.past
        else:
            sums, past = after.sums, self._whole.plus(after.past)
        return Odometry(windows, self.at, self.length, last, sums, past, undone)

    def _followed_by(self, piece: Piece, after: Odometry) -> bool:
        """Whether later windows are one piece, and begin where this one's last ends."""
        if piece.windows != after.windows or after.length != self.length:
            return False
        apart = (piece.time - self.piece.time) / self.length
        return abs(apart - 0.5 * (self.piece.windows + piece.windows)) < 0.5

    def _between(self, piece: Piece) -> Sums:
        """Of the means of the last piece and of one that follows."""
        mine = self.piece
        share = piece.windows / (mine.windows + piece.windows)
        weight = self.length * mine.windows * share
        time = piece.time - mine.time
        rim, travel = piece.rim - mine.rim, piece.travel - mine.travel
        return Sums(weight * time * time, weight * time * rim, weight * time * travel)


def of_window(
    at: int,
    length: float,
    ways: tuple[float, float],
    speeds: tuple[float, float],
    undone: tuple[float, float],
) -> Odometry:
    """One window of so many seconds about `at` [ns]: way of rim and carriage [m], their speeds as
    read [m/s], and what effects add to these.
    """
    within = length**3 / 12.0
    rim, travel = speeds
    sums = Sums(within, rim * within, travel * within)
    return Odometry(1, at, length, Piece(1, 0.0, *ways), sums, Past(), undone)
