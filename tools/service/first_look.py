"""Whether the first seconds in which the wheel drives can be: once, with a line for what cannot.

What is reported changes neither the estimate nor the recording's ticks.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.daemon.notice import Notice
from gritd.estimator.messages.tick import TICK_NAMES
from gritd.estimator.plausibility.clock import ReadingTimes
from gritd.estimator.plausibility.driven import MOVES, DrivenRun, RunWindows, with_driving
from gritd.estimator.plausibility.words import warnings

LOOKS = 100  # ten a second, while the wheel drives
COLUMNS = (
    *("wheel_speed", "carriage_speed", "sinkage", "load", "torque", "drawbar_pull"),
    "wheel_speed_sigma",
)
PLACES = tuple(TICK_NAMES.index(name) for name in COLUMNS)
SPEED, NOISE = COLUMNS.index("wheel_speed"), COLUMNS.index("wheel_speed_sigma")
EVALUATED = TICK_NAMES.index("evaluated")


class FirstLook:
    """Follows the ticks, in order, as often as it is asked to."""

    def __init__(self) -> None:
        self._seen: list[tuple[float, ...]] = []
        self._at = 0.0
        self._over = False

    def look(self, tick: tuple[float, ...], settings: Settings) -> Iterator[Notice]:
        """What cannot be, once there is enough to tell. settings: of the run."""
        if self._over or tick[EVALUATED] == self._at:
            return
        self._at = tick[EVALUATED]
        values = tuple(float(tick[place]) for place in PLACES)
        if abs(values[SPEED]) > MOVES * values[NOISE] > 0.0:
            self._seen.append(values)

        if len(self._seen) == LOOKS:
            self._over = True
            for line in warnings([(_driven(self._seen, settings), settings)]):
                yield Notice(line)


def _driven(seen: list[tuple[float, ...]], settings: Settings) -> DrivenRun:
    speed, travel, sinkage, load, torque, pull, noise = np.array(seen).T
    radius = settings.wheel.radius
    course = RunWindows(
        radius * speed, travel, sinkage, load, torque, pull, np.zeros(speed.size, dtype=bool)
    )
    window = 1.0 / settings.rates.update
    return DrivenRun(
        "", with_driving(course, radius * noise), ReadingTimes(0.0, 0.0, 0), window, np.inf, None
    )
