"""A device's wrapping microsecond clock mapped to ours, so that batching on the way is not read
as speed, and a wrong stamp costs one sample.

Bytes arrive late by a delay that is never negative: USB adapters hold them for up to 16 ms,
schedulers add more. `clock_line` finds the line under these delays. A frame from before it, or a
late one whose time goes back, has a wrong time and gets no stamp. The frames of the last moment
vote: where most of them agree on another line, and delay does not explain it, the device's clock
has stepped. As in NTP an outlier is suppressed, and a step is believed when it has lasted:
D. Mills, RFC 5905, sections 10 and 11.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median_low
from typing import NamedTuple

from gritd.drivers.clock_line import ClockLine

LATE = 20e6  # [ns] longer than a USB adapter holds a frame back
EARLY = 10e6  # [ns] what comes earlier than this over the line has a wrong time
WINDOW = 0.15e9  # [ns] in which frames vote; they have to agree for
MOST = 2 / 3  # of it, and so many of them, for some may be wrong
PAUSE = 40_000_000  # [ns] between two frames: more does not count in the window
TOGETHER = 0.5e6  # [ns] frames that come so close upon each other have one vote
USELESS = 0.5e9  # [ns] without any frame that could be right: the clock has another rate
SILENCE = 5.5e9  # [ns] without one on the line: longer than a computer is expected to stand still


class Vote(NamedTuple):
    """The last frame of those that came together, which waited least [ns].

    age: since the first vote, without pauses. is_possible: their times could be right, and none is
    older than the two before it.
    """

    time: int
    offset: int  # receive time − device time
    age: int
    is_possible: bool = True

    @property
    def received(self) -> int:
        return self.time + self.offset


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
        self._begin(0, 0)
        self.restart()

    def restart(self) -> None:
        """Forget the mapping: the device was reopened. The drift of its crystal is kept."""
        self._is_started = False

    def stamps(self, device_us: Sequence[int], received: int) -> list[int | None]:
        """When the samples of one chunk were taken [ns, our clock], None where the device's time
        cannot be right; `received` [ns] is when the chunk came.

        The whole chunk is looked at before any of it is stamped: its last frame waited least.
        """
        if not device_us:
            return []
        if not self._is_started:
            self._begin(device_us[-1] * 1000, received)
        elif received - self._on_line > SILENCE:
            self._unsettle(received)

        times = [self._unwrapped(us * 1000, received) for us in device_us]
        right = self._judged(times, received)
        kept = [time for time, is_right in zip(times, right, strict=True) if is_right]
        self.rejected += len(times) - len(kept)
        if not kept:
            return [None] * len(times)

        self._follow(max(kept), received)
        stamps = self._stamped(kept, received)
        return [
            stamps[time] if is_right else None for time, is_right in zip(times, right, strict=True)
        ]

    # --- the mapping
    # --------------------------------------------------------------------

    def _begin(self, time: int, received: int) -> None:
        """Begin the mapping at this frame."""
        self._is_started = True
        self._heard = received  # when a frame last came that could be right
        self._newest = self._second = time  # the two latest that were on the line
        self._before = time, time  # the last two
        self._last: tuple[int, int] | None = None  # the newest sample's device time and stamp
        self._line.begin([(time, received - time)])
        self._unsettle(received)

    def _unsettle(self, received: int) -> None:
        """The line follows the lowest delays at once, until it has been confirmed."""
        self._is_settled = False
        self._votes: list[Vote] = []
        self._age = 0  # time in which frames came, and when the last did
        self._came = received
        self._on_line = self._doubted = received  # when a frame last was, and the first since not
        self._seen = self._off = 0  # chunks since then, and those off the line

    def _begin_again(self, time: int, received: int) -> None:
        """Forget the mapping and begin it at a frame of the same device. It was switched on where
        its clock went back and shows no more than the time since it was heard.
        """
        shown, silent = time % self._modulus, received - self._heard
        self.restarts += shown < self._newest % self._modulus and shown <= silent + EARLY
        self._begin(time, received)
        self._vote(time, received, True)

    def _unwrapped(self, wrapped: int, received: int) -> int:
        """Device time without wraps [ns]: the turn of the clock nearest to where our own clock
        expects it.
        """
        expected = received - self._line.at(self._newest)
        half = self._modulus // 2
        return expected + (wrapped - expected + half) % self._modulus - half

    def _delay(self, time: int, received: int) -> int:
        """How long a frame was on its way, over the line [ns]."""
        return received - time - self._line.at(time)

    # --- which times are right
    # --------------------------------------------------------------------

    def _judged(self, times: list[int], received: int) -> list[bool]:
        """Whether the time of each frame of a chunk can be right."""
        delays = [self._delay(time, received) for time in times]
        right = self._possible(times, delays)
        is_possible = right[-1] and not self._went_back(times)
        self._vote(times[-1], received, is_possible)

        if not self._is_settled:
            if min(times) < self._second - LATE:
                self._begin_again(times[-1], received)
            return [True] * len(times)
        if -EARLY <= delays[-1] <= LATE:
            self._on_line, self._off = received, 0
            return right
        if self._has_stepped():
            return self._judged(times, received)

        self._doubted = self._doubted if self._off else received
        self._off += 1
        right = [
            is_right and not (delay > LATE and self._is_suspect(received - time, is_possible))
            for is_right, delay, time in zip(right, delays, times, strict=True)
        ]
        if received - max(self._heard, self._doubted) >= USELESS and not any(right):
            self._begin_again(times[-1], received)
            return [True] * len(times)
        return right

    def _possible(self, times: list[int], delays: list[int]) -> list[bool]:
        """False for a frame from before the line, and for a late one whose time goes back."""
        possible, newest, second = [], self._newest, self._second
        for time, delay in zip(times, delays, strict=True):
            possible.append(delay >= -EARLY and not (delay > LATE and time < second))
            if -EARLY <= delay <= LATE:
                newest, second = max(newest, time), max(second, min(newest, time))
        return possible

    def _went_back(self, times: list[int]) -> bool:
        """Whether one is older than the two before it."""
        first, second = self._before
        went_back = False
        for time in times:
            went_back = went_back or time < min(first, second)
            first, second = second, time
        self._before = first, second
        return went_back

    def _vote(self, time: int, received: int, is_possible: bool) -> None:
        """Take up a frame as a vote, and drop the old ones."""
        votes, self._age = self._votes, self._age + min(received - self._came, PAUSE)
        self._came = received

        vote = Vote(time, received - time, self._age, is_possible)
        if votes and self._age - votes[-1].age < TOGETHER:
            before = votes.pop()
            vote = vote._replace(age=before.age, is_possible=is_possible and before.is_possible)
        votes.append(vote)

        while self._age - votes[0].age > WINDOW:
            del votes[0]

    def _agreed(self) -> list[Vote]:
        """The votes for one line: most of them, for a while; none as long as there is no such."""
        middle = median_low(vote.offset for vote in self._votes)
        agreed = [vote for vote in self._votes if abs(vote.offset - middle) <= LATE]
        has_lasted = agreed[-1].age - agreed[0].age >= MOST * WINDOW
        return agreed if has_lasted and len(agreed) >= MOST * len(self._votes) else []

    def _has_stepped(self) -> bool:
        """Whether the device's clock has jumped: go on from the frames that say so. Late ones may
        have been held up by a computer that is too slow, unless the clock went back.
        """
        agreed = self._agreed()
        off = median_low(self._delay(vote.time, vote.received) for vote in agreed or self._votes)
        is_explained = off > LATE and all(vote.is_possible for vote in self._votes)
        if not agreed or -EARLY <= off <= LATE or is_explained:
            return False

        first = agreed[0]
        before = self._line.at(first.time)
        self._begin_again(first.time, first.received)
        self._line.begin([(vote.time, vote.offset) for vote in agreed])
        self._is_settled = True
        self.steps += 1
        self.step = (before - self._line.at(first.time)) * 1e-9
        return True

    def _is_suspect(self, offset: int, is_possible: bool) -> bool:
        """Whether a late frame belongs to others that nothing but a step explains. Its own vote may
        be that of several, so it is judged by itself.
        """
        votes = [*self._votes[:-1], self._votes[-1]._replace(is_possible=is_possible)]
        since = [vote for vote in votes if vote.received >= self._doubted]
        return sum(not v.is_possible and abs(offset - v.offset) <= LATE for v in since) > 1

    # --- stamps
    # -----------------------------------------------------------------------------------

    def _follow(self, time: int, received: int) -> None:
        """Let the line see the frame of a chunk that waited least, unless it was held up."""
        self._heard = received
        if not self._is_settled:
            self._settle(time, received)
        elif self._delay(time, received) > LATE:
            return
        else:
            self._line.add((time, received - time))

        self._second = max(self._second, min(self._newest, time))
        self._newest = max(self._newest, time)

    def _settle(self, time: int, received: int) -> None:
        """Follow the least delay, but for a single one far from the others, for a while. Where most
        frames have not been on the line then, begin again.
        """
        points = sorted((vote.offset, vote.time) for vote in self._votes)
        if len(points) > 1 and points[1][0] - points[0][0] > EARLY:
            del points[0]

        below = -self._delay(points[0][1], sum(points[0]))
        if below > 0:
            self._line.begin([(at, offset) for offset, at in points])
        if below > EARLY:
            self._on_line, self._seen, self._off = received, 0, 0

        self._seen += 1
        self._off += self._delay(time, received) > LATE
        if received - self._on_line < MOST * WINDOW:
            return
        if self._off > MOST * self._seen:
            self._begin(time, received)
        else:
            self._is_settled, self._off = True, 0

    def _stamped(self, times: list[int], received: int) -> dict[int, int]:
        """The stamp of each time of a chunk, in the order sent: by the line for the newest, evenly
        between that and the last stamp for those before, for the line may have moved: no sample may
        look like a jump. One that is newer than those sent after it is wrong.
        """
        stamps = {time: min(time + self._line.at(time), received) for time in times}
        newest, last = max([times[-1], *sorted(times)[-2:-1]]), self._last
        if last is None:
            self._last = newest, stamps[newest]
            return stamps
        if newest <= last[0]:
            return stamps | {last[0]: last[1]}

        end = min(max(stamps[newest], last[1] + len(times)), received)
        self._last = newest, end
        return stamps | {
            time: last[1] + (end - last[1]) * (time - last[0]) // (newest - last[0])
            for time in times
            if last[0] <= time <= newest
        }
