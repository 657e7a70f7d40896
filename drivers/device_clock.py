"""A device's wrapping microsecond clock mapped to ours, so that batching on the way is not read
as speed, and a wrong stamp costs one sample.

Bytes arrive late by a delay that is never negative: USB adapters hold them for up to 16 ms,
schedulers add more. `clock_line` finds the line under these delays. A frame from before it, or one
whose time goes back, has a wrong time: it gets no stamp, and the line does not see it. Where
frames agree for a tenth of a second that the line is elsewhere (`clock_step`), the device's clock
has stepped.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

from gritd.drivers.clock_line import STRAY, ClockLine
from gritd.drivers.clock_step import FLAT, Doubt, Rival

LATE = 20e6  # [ns] longer than a USB adapter holds a frame back
SILENCE = 10e9  # [ns] after which the drift is not trusted
MARGIN = 10e6  # [ns] for the drift


class DeviceClock:
    """Stamps for the frames of one key, in the order sent; their clock wraps at `modulus_us` µs.

    A stamp is never later than the receive time and grows with the device time. What remains is
    the smallest delay of the last 20 s, a constant that belongs into the channel's latency.
    """

    def __init__(self, modulus_us: int = 1 << 32) -> None:
        self.rejected = 0  # frames of a time that cannot be
        self.steps = 0  # times the device's clock jumped
        self.step = 0.0  # how far, the last time [s]
        self.restarts = 0  # times it began at zero: the device was switched on
        self._modulus = modulus_us * 1000
        self._line = ClockLine()
        self._seen: list[int] = []  # the two latest device times, late or not
        self._start(0, 0)
        self.restart()

    def restart(self) -> None:
        """Forget the mapping: the device was reopened. The drift of its crystal is kept."""
        self._started = False
        self._last: tuple[int, int] | None = None  # the newest sample's device time and stamp

    def stamps(self, device_us: Sequence[int], received: int) -> list[int | None]:
        """When the samples of one chunk were taken [ns, our clock], None where the device's time
        cannot be right; `received` [ns] is when the chunk came.

        The whole chunk is looked at before any of it is stamped: its last frame waited least.
        """
        if self._started and received - self._newest_received > SILENCE:
            self._line.unsettle()

        times = [self._unwrap(us * 1000, received) for us in device_us]
        right = self._judged(times, received) if times else []
        kept = [time for time, is_right in zip(times, right, strict=True) if is_right]
        self.rejected += len(times) - len(kept)

        if kept:
            self._follow(max(kept), received)
            self._seen = sorted([*self._seen, *kept])[-2:]

        end = self._squeezed(kept, received)
        return [
            self._stamp(time, received, end) if is_right else None
            for time, is_right in zip(times, right, strict=True)
        ]

    # --- which times are right
    # --------------------------------------------------------------------

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
        self._newest = self._second = time  # the two latest that came without much delay
        self._newest_received = received
        self._seen = [time, time]
        self._line = ClockLine(self._line.slope)
        self._doubt = Doubt()

    def _judged(self, times: list[int], received: int) -> list[bool]:
        """Whether the time of each frame of a chunk can be right."""
        if not self._line.settled:
            if self._went_back(times, LATE):
                self._begin_again(times[-1], received)
            return [True] * len(times)

        delays = [self._delay(time, received) for time in times]
        possible = self._possible(times, delays)
        if -STRAY <= min(delays) <= LATE:
            self._doubt = self._doubt.calmed(received)
            return possible
        return self._doubted(times, received, delays, possible)

    def _doubted(
        self, times: list[int], received: int, delays: list[float], possible: list[bool]
    ) -> list[bool]:
        """The same of a chunk that is not on the line: others may agree with it on another one."""
        impossible = [delay for delay, ok in zip(delays, possible, strict=True) if not ok]
        rival = Rival(max(times), received, min(delays))
        went_back = self._went_back(times) or min(times) < self._newest - STRAY
        self._doubt.add(rival, impossible, went_back)
        if agreed := self._doubt.agreed():
            self._step(agreed, received)
            return self._judged(times, received)

        right = [
            ok and not (delay > LATE and self._doubt.suspects(delay))
            for ok, delay in zip(possible, delays, strict=True)
        ]
        if self._doubt.is_hopeless(any(right)):
            self._begin_again(times[-1], received)
            return [True] * len(times)
        return right

    def _possible(self, times: list[int], delays: list[float]) -> list[bool]:
        """False for a frame from before the line, and for a late one whose time goes back."""
        possible, newest, second = [], self._newest, self._second
        for time, delay in zip(times, delays, strict=True):
            possible.append(delay >= -STRAY and not (delay > LATE and time < second))
            if -STRAY <= delay <= LATE:
                newest, second = max(newest, time), max(second, min(newest, time))
        return possible

    def _went_back(self, times: list[int], by: float = 0.0) -> bool:
        """Whether a frame is older than two of those before it, be they late or not, by so much."""
        seen = self._seen
        for time in times:
            if time < seen[0] - by:
                return True
            seen = sorted([*seen, time])[-2:]
        return False

    def _step(self, agreed: list[Rival], now: int) -> None:
        """The device's clock has jumped: go on from the frames that say so, but for a wrong one.
        The present chunk is followed later.
        """
        least = median(rival.delay for rival in agreed) - FLAT
        rivals = [rival for rival in agreed if rival.delay >= least]

        self.steps += 1
        self.step = -min(rival.delay for rival in rivals) * 1e-9
        self._begin_again(rivals[0].time, rivals[0].received)

        for rival in rivals:
            if rival.received < now:
                self._follow(rival.time, rival.received)

    def _begin_again(self, time: int, received: int) -> None:
        """Forget the mapping and begin it at a frame of the same device."""
        self.restarts += self._has_restarted(time % self._modulus, received)
        self._last = None
        self._start(time, received)

    def _has_restarted(self, shown: int, received: int) -> bool:
        """Whether the device's clock went back and shows no more than the time since it was
        heard.
        """
        silent = received - self._newest_received
        return shown < self._newest % self._modulus and shown <= silent + MARGIN

    # --- stamps
    # -----------------------------------------------------------------------------------

    def _follow(self, time: int, received: int) -> None:
        """Let the line see the frame of a chunk that waited least, unless it was held up."""
        if self._line.settled and self._delay(time, received) > LATE:
            return
        self._line.add((float(time - self._first), self._offset(time, received)))

        if self._delay(self._newest, self._newest_received) < -STRAY:
            # a wrong time, taken before the line was known: nothing is measured from it
            self._newest = self._second = time
            self._newest_received = received

        self._second = max(self._second, min(self._newest, time))
        if time > self._newest:
            self._newest, self._newest_received = time, received

    def _offset(self, time: int, received: int) -> float:
        return float(received - time - self._origin)

    def _delay(self, time: int, received: int) -> float:
        """How long a frame was on its way, over the line [ns]."""
        return self._offset(time, received) - self._line.at(float(time - self._first))

    def _squeezed(self, times: list[int], received: int) -> tuple[int, int] | None:
        """Device time and stamp of the chunk's newest sample where the line does not fit between
        the last stamp and the receive time: it was pushed down since, or has yet to be.
        """
        last = self._last
        fresh = sorted(time for time in times if last is not None and time > last[0])
        if last is None or not fresh:
            return None
        second = fresh[-2] if len(fresh) > 1 else fresh[0]  # the newest may be wrong
        fits = self._mapped(fresh[0]) > last[1] and self._mapped(second) <= received
        return None if fits else (fresh[-1], min(self._mapped(fresh[-1]), received))

    def _mapped(self, time: int) -> int:
        return time + self._origin + round(self._line.at(float(time - self._first)))

    def _stamp(self, time: int, received: int, end: tuple[int, int] | None) -> int:
        stamp = min(self._mapped(time), received)
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
