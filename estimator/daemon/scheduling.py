"""How the process is scheduled: real-time priority, cores, interpreter switches, garbage
collection.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

SWITCH_INTERVAL = 0.0005  # [s] how soon the loop gets the interpreter back from another thread
# of SCHED_FIFO, for all threads: for the loop alone it would starve the readers. The loop comes
# first by one: on the core that it shares with them it would wait for a backlog of theirs.
PRIORITY, FIRST = 19, 20
# Collections of younger objects after which all of them are gone through: that takes 1 ms and more,
# a tick at 1 kHz. By default it comes every 10 s, so every few hours.
YOUNGER = 10_000


@contextmanager
def undisturbed() -> Iterator[None]:
    """Short switch interval, no garbage collection of what was built at start, and few of all that
    came since.
    """
    interval, (first, second, third) = sys.getswitchinterval(), gc.get_threshold()

    sys.setswitchinterval(SWITCH_INTERVAL)
    gc.set_threshold(first, second, YOUNGER)
    gc.collect()
    gc.freeze()

    try:
        yield
    finally:
        gc.unfreeze()
        gc.set_threshold(first, second, third)
        sys.setswitchinterval(interval)


@contextmanager
def on_one_core() -> Iterator[None]:
    """Threads started here stay on one core. They take turns with the interpreter anyway; on one
    core a turn is passed without waking another, and what one leaves in the caches serves the next.

    It is the last core that is allowed: interrupts go to the first as a rule.
    """
    try:
        allowed = os.sched_getaffinity(0)
        os.sched_setaffinity(0, {max(allowed)})
    except (OSError, AttributeError):  # forbidden, or no Linux: they run where they like
        yield
        return

    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def real_time() -> str:
    """Real-time scheduling for this thread and those it starts; '' or one line why not."""
    return _scheduled(PRIORITY)


def first() -> None:
    """Put this thread before the others, where they have real-time scheduling."""
    with suppress(AttributeError):
        if os.sched_getscheduler(0) == os.SCHED_FIFO:
            _scheduled(FIRST)


def _scheduled(priority: int) -> str:
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        return ""
    except (OSError, AttributeError) as error:
        reason = getattr(error, "strerror", None) or error
        return f"no real-time scheduling ({reason}): ticks may be late under load"
