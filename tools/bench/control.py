"""What this computer does to any loop: one that only sleeps, next to the daemon's, on its core and
before it.

    python -m gritd.tools.bench.control HERTZ FILE.npy

It wakes at a rate and notes how late, until it is asked to end; then it writes the deadlines [ns of
the daemon's clock] and latenesses [ns], shape (n, 2). Nothing of gritd runs in it, and it
interrupts the daemon: when it is late, the system or the virtual machine held the core.
"""

from __future__ import annotations

import gc
import os
import signal
import sys
from array import array
from contextlib import suppress

import numpy as np

from gritd.estimator.daemon.clock import NS, Clock
from gritd.estimator.daemon.scheduling import FIRST, on_one_core

ROOM = 120.0  # [s] for which memory is taken before


def main(hertz: float, path: str) -> None:
    """Sleep until SIGTERM, then write."""
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda *_: ended.append(1))
    gc.disable()
    with suppress(OSError, AttributeError):  # no right to: as late as any other process
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(FIRST + 1))

    period = round(NS / hertz)
    deadlines, late = (array("q", bytes(8 * round(ROOM * hertz))) for _ in range(2))
    with on_one_core():
        clock, count = Clock(), 0
        deadline = clock.now() + period
        while not ended and count < len(late):
            clock.sleep_until(deadline)
            deadlines[count], late[count] = deadline, clock.now() - deadline
            deadline += period * (late[count] // period + 1)
            count += 1

    np.save(path, np.column_stack((deadlines, late))[:count])


if __name__ == "__main__":
    main(float(sys.argv[1]), sys.argv[2])
