"""The line between a device's clock and ours: the lower edge of the delays on the way.

Receive time − device time is a line (offset and drift between two crystals) plus a delay that is
never negative. The line is therefore the lower edge of these differences. The edge of their
lower convex hull over the middle of a sliding window gives the drift, and the line is pushed
down until it touches the lowest points.

No point moves the line alone: of each block of time the lowest counts that another comes close
to. Where the edge of the last second lies elsewhere than that of the time before, the time
before is forgotten.

S. Moon, P. Skelly, D. Towsley, Estimation and removal of clock skew from network delay
measurements, IEEE INFOCOM 1999, Eq. (4): the line under all points that is closest to them is
that edge of the hull.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

from gritd.drivers.clock_step import ENOUGH, STEADY

Point = tuple[float, float]  # (device time, receive − device), both since the first frame [ns]

BLOCK = 0.2e9  # [ns]
LEAST = 4  # points in a block: a slow sensor has longer ones
BLOCKS = 100  # a window of 20 s
RECENT = 4  # blocks that outweigh those before where they lie higher: 0.8 s
CLOSE = 0.5e6  # [ns] between the lowest point and the second: else the lowest is alone
SURE = 2  # of these are kept then
KNOWN = 15  # blocks before them that show how much the way itself varies: 3 s
HELD = 20e6  # [ns] a USB adapter holds a frame back for less
SLOPE_AFTER = 25  # blocks: a window of less than 5 s does not tell drift from delay; until then
LATEST = 10  # blocks are looked at, in which the drift is small: 2 s
MAX_DRIFT = 300e-6  # two crystals of ±100 ppm, and a poor resonator
MOVED = 1e6  # [ns] an edge this far from the one before is another one
STRAY = 10e6  # [ns] what comes earlier than this was not held up by the way: its time is wrong


class ClockLine:
    """Offset of our clock over the device's, as a function of the device time.

    Until it is `settled`, it follows the lowest points at once: the first frames may have waited
    in a buffer for seconds.
    """

    def __init__(self, slope: float = 0.0) -> None:
        self.slope = slope
        self.settled = False
        self._known = slope != 0.0  # the drift
        self._level = 0.0
        self._steady = (0.0, 0, 0)  # since when [ns], points since then, those close to the line
        self._stray = False  # whether the last point lay far below
        self._blocks: deque[list[Point]] = deque(maxlen=BLOCKS)  # of each the two lowest points
        self._open: list[Point] = []  # those of the present block
        self._count, self._began = 0, 0.0  # points in it, and when it began [ns]

    def at(self, time: float) -> float:
        """The offset [ns] at a device time [ns]."""
        return self._level + self.slope * time

    def unsettle(self) -> None:
        """After a long silence the drift may have carried the line away."""
        self.settled = False
        self._steady = (0.0, 0, 0)

    def add(self, point: Point) -> None:
        """Take up the frame of a chunk that waited least."""
        received = sum(point)
        if not self.settled:
            self._settle(point, received)
        self._open = sorted([*self._open, point], key=self._height)[:2]
        self._count += 1
        if len(self._open) == 2:
            self._level = min(self._level, self._height(self._lower(self._open)))
        if received - self._began >= BLOCK and self._count >= LEAST:
            self._close(received)

    def _height(self, point: Point) -> float:
        """Of a point, over a line of our slope through zero."""
        return point[1] - self.slope * point[0]

    def _settle(self, point: Point, received: float) -> None:
        """Follow the lowest points, until half of the points for a while lie close to them. A
        single one far below the others is a wrong time; with the second in a row a backlog ends.
        """
        height = self._height(point)
        since, seen, near = self._steady
        is_alone = received - since >= STEADY and seen > ENOUGH and 2 * near < seen

        stray, before = height < self._level - STRAY, self._stray
        self._stray = stray

        if not seen or (stray and before) or is_alone:
            self._blocks.clear()
            self._begin(received)
            self._level = height
            since, seen, near, stray = received, 0, 0, False

        if not stray:
            self._level = min(self._level, height)
        seen, near = seen + 1, near + (not stray and height - self._level <= HELD)
        self._steady = (since, seen, near)
        self.settled = received - since >= STEADY and near >= ENOUGH and 2 * near >= seen

    def _begin(self, now: float) -> None:
        self._open, self._count, self._began = [], 0, now

    def _close(self, now: float) -> None:
        """End the block and fit the line anew."""
        self._blocks.append(self._open)
        self._begin(now)
        self._forget()
        edge = sorted(map(self._lower, self._blocks))
        if len(edge) >= SLOPE_AFTER:
            self.slope = max(-MAX_DRIFT, min(MAX_DRIFT, hull_slope(edge)))
            self._known = True
        self._level = self._lowest(list(self._blocks)[0 if self._known else -LATEST :])

    def _forget(self) -> None:
        """Drop what lies before the edge moved up or down: the clock made a small step, or the
        way changed.
        """
        blocks = list(self._blocks)
        before, recent = blocks[:-RECENT], blocks[-RECENT:]
        levels = [self._height(self._lower(block)) for block in before]

        if len(levels) >= KNOWN and self._second(recent) - max(levels) > MOVED:
            self._blocks = deque(
                recent[-SURE:], BLOCKS
            )  # the first of them may lie across the step
        elif len(blocks) > 1 and self._lowest(blocks[:-1]) - self._lowest(blocks[-1:]) > MOVED:
            self._blocks = deque(blocks[-1:], BLOCKS)

    def _lower(self, block: list[Point]) -> Point:
        """The lowest point of a block that is not alone."""
        lowest, second = block
        return second if self._height(second) - self._height(lowest) > CLOSE else lowest

    def _lowest(self, blocks: Iterable[list[Point]]) -> float:
        return min(self._height(self._lower(block)) for block in blocks)

    def _second(self, blocks: Iterable[list[Point]]) -> float:
        return sorted(self._height(point) for block in blocks for point in block)[1]


def hull_slope(points: Sequence[Point]) -> float:
    """Slope of the lower convex hull's edge over the mean abscissa; points sorted by abscissa,
    two or more.
    """
    hull: list[Point] = []

    for point in points:
        while len(hull) >= 2 and _turns_down(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)

    middle = sum(x for x, _ in points) / len(points)
    right = next((i for i, (x, _) in enumerate(hull) if x > middle and i > 0), len(hull) - 1)
    (x0, y0), (x1, y1) = hull[right - 1], hull[right]
    return (y1 - y0) / (x1 - x0)


def _turns_down(a: Point, b: Point, c: Point) -> bool:
    """Whether b lies on or above the line from a to c."""
    return (b[0] - a[0]) * (c[1] - a[1]) <= (b[1] - a[1]) * (c[0] - a[0])
