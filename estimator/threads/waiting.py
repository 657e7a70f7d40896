"""Waiting for what should end soon, in a process that may be held up.

Counted in looks, not by the clock: a process that was stopped or starved looks less often too, and
must not take its own absence for another thread's delay.
"""

from __future__ import annotations

import time
from collections.abc import Callable

LOOK = 0.01  # [s] between looks


def wait_until(over: Callable[[], bool], seconds: float) -> float:
    """Look until it is over, for so many seconds at most; what is left of them, 0 where it is not
    over.
    """
    looks = round(seconds / LOOK)
    for look in range(looks):
        if over():
            return seconds * (1.0 - look / looks)
        time.sleep(LOOK)
    return 0.0
