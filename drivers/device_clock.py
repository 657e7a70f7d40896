"""A device's wrapping microsecond clock mapped to ours, so that batching on the way is not read as
speed.

Bytes arrive late by a delay that is never negative: USB adapters hold them for up to 16 ms,
schedulers add more. The difference receive time − device time is therefore a line (offset and drift
between two crystals) plus a positive delay, and the line is its lower envelope. A sliding window
keeps the smallest difference of each block of time; the edge of their lower convex hull over the
middle of the window gives the drift, and the line is pushed down until it touches the lowest point.

S. Moon, P. Skelly, D. Towsley, Estimation and removal of clock skew from network delay
measurements, IEEE INFOCOM 1999, Eq. (4): the line under all points that is closest to them is that
edge of the hull.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

Point = tuple[
    float, float
]  # (device time [ns since the first frame], receive − device [ns, less the first one])

BLOCK = 0.5e9  # [ns]
BLOCKS = 40  # a window of 20 s
SLOPE_AFTER = 2e9  # [ns] a shorter window does not tell drift from delay
MAX_DRIFT = 200e-6  # two crystals of ±100 ppm
RESTART_DROP = 10e6  # [ns] a point this far below the line says that the line knows nothing
RESET_STEP = 500_000_000  # [ns] a device clock going back by this much, or forward, was reset


class DeviceClock:
    """Stamps for the frames of one device clock that wraps at `modulus_us` µs.

    A stamp is never later than the receive time and grows with the device time. What remains is the
    smallest delay of the last 20 s, a constant that belongs into the channel's latency.
    """

    _newest: int  # latest device time [ns], unwrapped
    _newest_received: int  # and when it came [ns]

    def __init__(self, modulus_us: int = 1 << 32) -> None:
        self.resets = 0  # times the device clock was seen to start anew
        self._modulus = modulus_us * 1000
        self._slope = 0.0
        self._start(0, 0)
        self.restart()

    def restart(self) -> None:
        """Forget the mapping: the device was reopened. The drift of its crystal is kept."""
        self._started = False
        self._last: tuple[int, int] | None = None  # the newest sample's device time and stamp

    def stamps(self, device_us: Sequence[int], received: int) -> list[int]:
        """When the samples of one chunk were taken [ns, our clock]; `received` [ns] is when the
        chunk came.

        The whole chunk is looked at before any of it is stamped: its last frame waited least.
        """
        stamps: list[int] = []
        times: list[int] = []
        for us in device_us:
            time = self._unwrap(us * 1000, received)
            if time < self._newest - RESET_STEP:
                stamps += self._settle(times, received)
                times = []
                self.resets += 1
                self._last = None
                self._start(time, received)
            elif time > self._newest:
                self._newest = time
                self._newest_received = received
            times.append(time)
        return stamps + self._settle(times, received)

    def _settle(self, times: list[int], received: int) -> list[int]:
        """Look at the samples of one chunk, then stamp them."""
        for time in sorted(times, reverse=True):
            self._observe(time, received)
        end = self._squeezed(times, received)
        return [self._stamp(time, received, end) for time in times]

    def _squeezed(self, times: list[int], received: int) -> tuple[int, int] | None:
        """Device time and stamp of the chunk's newest sample where its oldest new one would be
        stamped before the last chunk's: the line was pushed down below that.
        """
        last = self._last
        fresh = [time for time in times if last is not None and time > last[0]]
        if last is None or not fresh or self._mapped(min(fresh), received) > last[1]:
            return None
        return max(fresh), self._mapped(max(fresh), received)

    def _unwrap(self, wrapped: int, received: int) -> int:
        """Device time without wraps [ns]: the turn of the clock nearest to where our own clock
        expects it.
        """
        if not self._started:
            self._start(wrapped, received)
        expected = self._newest + received - self._newest_received
        half = self._modulus // 2
        return expected + (wrapped - expected + half) % self._modulus - half

    def _start(self, time: int, received: int) -> None:
        """Begin the mapping at this frame."""
        self._started = True
        self._origin = received - time
        self._first = time
        self._newest = time
        self._newest_received = received
        self._intercept = 0.0
        self._blocks: deque[Point] = deque(maxlen=BLOCKS)
        self._lowest: Point = (0.0, 0.0)
        self._block_end = BLOCK

    def _observe(self, time: int, received: int) -> None:
        at, offset = float(time - self._first), float(received - time - self._origin)
        below = self._line(at) - offset
        if below > RESTART_DROP:
            self.resets += below > RESET_STEP
            self._start(time, received)
            return
        if below > 0.0:
            self._intercept -= below
        if at >= self._block_end:
            self._close_block(at, offset)
        elif offset - self._slope * at < self._lowest[1] - self._slope * self._lowest[0]:
            self._lowest = (at, offset)

    def _close_block(self, at: float, offset: float) -> None:
        """Keep the block's lowest point, begin the next block, and fit the line anew."""
        self._blocks.append(self._lowest)
        self._lowest = (at, offset)
        self._block_end = at + BLOCK
        closed = sorted(self._blocks)
        if closed[-1][0] - closed[0][0] >= SLOPE_AFTER:
            self._slope = max(-MAX_DRIFT, min(MAX_DRIFT, hull_slope(closed)))
        self._intercept = min(y - self._slope * x for x, y in [*closed, self._lowest])

    def _line(self, at: float) -> float:
        return self._intercept + self._slope * at

    def _mapped(self, time: int, received: int) -> int:
        return min(time + self._origin + round(self._line(float(time - self._first))), received)

    def _stamp(self, time: int, received: int, end: tuple[int, int] | None) -> int:
        stamp = self._mapped(time, received)
        if self._last is None or time > self._last[0]:
            if self._last is not None and end is not None:
                stamp = min(max(_between(self._last, end, time), self._last[1] + 1), received)
            self._last = (time, stamp)
        elif time == self._last[0]:
            stamp = self._last[1]
        return stamp


def _between(last: tuple[int, int], end: tuple[int, int], time: int) -> int:
    """A stamp between the last one and that of the chunk's newest sample, evenly: no sample may
    look like a jump.
    """
    return last[1] + (end[1] - last[1]) * (time - last[0]) // (end[0] - last[0])


def hull_slope(points: Sequence[Point]) -> float:
    """Slope of the lower convex hull's edge over the mean abscissa; points sorted by abscissa, two
    or more.
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
