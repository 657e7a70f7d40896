"""The line between a device's clock and ours: the lower edge of the delays on the way.

Receive time − device time is a line (offset and drift between two crystals) plus a delay that is
never negative. The line therefore touches the lowest of these differences. No point moves the line
alone: of each block of time the lowest counts that another comes close to.

S. Moon, P. Skelly, D. Towsley, Estimation and removal of clock skew from network delay
measurements, IEEE INFOCOM 1999.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

Point = tuple[int, int]  # device time, receive time − device time [ns]

BLOCK = 0.2e9  # [ns]
BLOCKS = 100  # a window of 20 s
CLOSE = 0.5e6  # [ns] between the lowest point and the second: else the lowest is alone
RECENT = 4  # blocks that outweigh those before where they lie elsewhere: 0.8 s
KNOWN = 12  # blocks that show how much the delay varies, and in which the drift is small: 2.4 s
SLOPE_AFTER = 25  # blocks: a window of less than 5 s does not distinguish drift from delay
MAX_DRIFT = 300e-6  # two crystals of ±100 ppm, and a poor resonator
MOVED = 1e6  # [ns] an edge this far from the one before is another one


class ClockLine:
    """Offset of our clock over the device's, as a function of the device time."""

    def __init__(self) -> None:
        self._slope = 0.0  # the drift
        self._is_known = False
        self._open: list[tuple[int, Point]] = []  # the block's two lowest points, with heights
        self.begin([(0, 0)])

    def at(self, time: int) -> int:
        """The offset [ns] at a device time [ns]."""
        return self._level + int(self._slope * (time - self._zero))

    def begin(self, points: Sequence[Point]) -> None:
        """Forget the line, but not the drift, and begin it at one or more points."""
        self._blocks: deque[Point] = deque(maxlen=BLOCKS)  # the lowest point of each
        self._zero = points[0][0]
        self._level = min(map(self._height, points))
        self._open_block(sum(points[0]))

        for point in points:
            self.add(point)

    def add(self, point: Point) -> None:
        """Take up the frame of a chunk that waited least."""
        self._open = sorted([*self._open, (self._height(point), point)])[:2]
        if len(self._open) < 2:
            return

        lowest, second = self._open
        height, edge = second if second[0] - lowest[0] > CLOSE else lowest
        self._level = min(self._level, height)
        if sum(point) - self._began >= BLOCK:
            self._blocks.append(edge)
            self._open_block(sum(point))
            self._fit()

    def _height(self, point: Point) -> int:
        return point[1] - int(self._slope * (point[0] - self._zero))

    def _open_block(self, now: int) -> None:
        self._open, self._began = [], now

    def _fit(self) -> None:
        if self._has_moved():
            self._blocks = deque([self._blocks[-1]], BLOCKS)
        if len(self._blocks) >= SLOPE_AFTER:
            self._slope, self._is_known = self._fitted(), True

        shown = list(self._blocks)[0 if self._is_known else -KNOWN :]
        self._level = min(map(self._height, shown))

    def _has_moved(self) -> bool:
        """Whether the edge has moved: the clock made a small step, or the way changed."""
        heights = list(map(self._height, self._blocks))
        before, recent = heights[:-RECENT], heights[-RECENT:]
        has_risen = len(before) >= KNOWN and min(recent) - max(before) > MOVED
        return has_risen or min(heights[:-1], default=-BLOCK) - heights[-1] > MOVED

    def _fitted(self) -> float:
        """The drift between the lowest points of the first and the last third of the window."""
        blocks = list(self._blocks)
        third = len(blocks) // 3
        (x0, y0), (x1, y1) = (min(of, key=self._height) for of in (blocks[:third], blocks[-third:]))
        return max(-MAX_DRIFT, min(MAX_DRIFT, (y1 - y0) / (x1 - x0)))
