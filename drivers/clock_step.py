"""Whether a device's clock has stepped: frames that agree with each other and not with the line.

As in NTP a single outlier is suppressed, and a step is believed when it has lasted for a while:
D. Mills, RFC 5905, sections 10 and 11.3.
"""

from __future__ import annotations

from collections import deque
from statistics import median
from typing import NamedTuple

STEADY = 0.1e9  # [ns] that frames have to agree, and
ENOUGH = 3  # so many of them: of a slow sensor that takes longer
MOST = 2 / 3  # of the frames since then have to be among them: some may be wrong
# [ns] between the delays of frames that agree: a USB adapter holds them back for 16 ms
NEAR = 20e6
# [ns] the delays of a backlog that is worked off fall; those over another line do not
FLAT = 10e6
RECENT = 0.2e9  # [ns] before frames agree that they are late, one must have gone back in time
TOGETHER = 5e6  # [ns] chunks that come so close upon each other count as one
KEPT = 8  # rivals that are remembered however long ago
MANY = 50  # impossible delays that are remembered
USELESS = 0.5e9  # [ns] without any frame that could be right, or
HOPELESS = 5e9  # [ns] without one on the line, and
TRIED = 20  # so many rivals: there is no such line


class Rival(NamedTuple):
    """The frame of a chunk that waited least, where that is not on the line [ns]."""

    time: int
    received: int
    delay: float


class Doubt:
    """The rivals since the last chunk on the line, for as long as they need to agree."""

    def __init__(self) -> None:
        self._rivals: list[Rival] = []
        self._impossible: deque[float] = deque(maxlen=MANY)  # delays that nothing else explains
        self._calm = self._on_line = 0  # chunks on the line since the last rival, and the first
        # when the first rival came, and the last chunk on the line
        self._began = self._calmed = 0
        self._tried = 0  # rivals since the first
        self._back = -RECENT  # when a frame last went back in time
        self._useful = 0  # when a frame last could be right

    def calmed(self, received: int) -> Doubt:
        """What is left after a chunk on the line. Two in a row end the doubt: one may be a wrong
        stamp by chance.
        """
        if self._rivals and received - self._calmed >= TOGETHER:
            self._calmed = received
            self._calm, self._on_line = self._calm + 1, self._on_line + 1
        return Doubt() if self._calm > 1 else self

    def add(self, rival: Rival, impossible: list[float], went_back: bool) -> None:
        """Take up a chunk, with the delays of those of its frames that nothing on the way
        explains, and whether one went back in time.
        """
        rivals, self._calm = self._rivals, 0
        self._impossible.extend(impossible)
        self._back = rival.received if went_back else self._back

        if rivals and rival.received - rivals[-1].received < TOGETHER:
            rivals[-1] = min(rivals[-1], rival, key=lambda one: one.delay)
            return

        if not rivals:
            self._began = self._useful = rival.received
        self._tried += 1
        rivals.append(rival)

        while len(rivals) > KEPT and rival.received - rivals[1].received >= STEADY:
            del rivals[0]

    def suspects(self, delay: float) -> bool:
        """Whether a frame of this delay belongs to others that nothing but a step explains."""
        return sum(abs(delay - other) <= NEAR for other in self._impossible) > 1

    def agreed(self) -> list[Rival]:
        """The rivals that make up a step; none as long as there is none. Late ones may have been
        held up by a computer that is too slow, however steadily, unless the clock went back.
        """
        middle = median(rival.delay for rival in self._rivals)
        agreed = [rival for rival in self._rivals if abs(rival.delay - middle) <= NEAR]
        if len(agreed) < max(ENOUGH, MOST * (len(self._rivals) + self._on_line)):
            return []
        lasted = agreed[-1].received - agreed[0].received
        certain = middle < 0.0 or agreed[0].received - self._back <= RECENT
        return agreed if lasted >= STEADY and certain and _is_flat(agreed) else []

    def is_hopeless(self, useful: bool) -> bool:
        """Whether there is no line for long, as with a clock of another rate. useful: whether the
        present chunk has a frame that could be right.
        """
        now = self._rivals[-1].received
        self._useful = now if useful else self._useful
        long = now - self._began >= HOPELESS and not self._on_line
        return self._tried >= TRIED and (long or now - self._useful >= USELESS)


def _is_flat(rivals: list[Rival]) -> bool:
    delays = [rival.delay for rival in rivals]
    half = len(delays) // 2
    return abs(median(delays[:half]) - median(delays[half:])) <= FLAT
