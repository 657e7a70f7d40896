"""How the daemon's threads are scheduled."""

from __future__ import annotations

import os
import sys
from threading import Thread

import pytest

from gritd.estimator.daemon.scheduling import (
    FIRST,
    PRIORITY,
    SWITCH_INTERVAL,
    first,
    on_one_core,
    real_time,
    undisturbed,
)


def cores_of_a_thread() -> set[int]:
    found: list[set[int]] = []
    thread = Thread(target=lambda: found.append(os.sched_getaffinity(0)))
    thread.start()
    thread.join()
    return found[0]


def test_threads_started_there_share_a_core_and_no_other_thread_does():
    allowed = os.sched_getaffinity(0)
    with on_one_core():
        assert cores_of_a_thread() == {max(allowed)}
    assert os.sched_getaffinity(0) == allowed == cores_of_a_thread()


def test_cores_are_given_back_where_something_fails():
    allowed = os.sched_getaffinity(0)
    with pytest.raises(ZeroDivisionError), on_one_core():
        raise ZeroDivisionError
    assert os.sched_getaffinity(0) == allowed


def test_where_cores_may_not_be_chosen_threads_run_where_they_like(monkeypatch):
    def refused(*_):
        raise PermissionError

    monkeypatch.setattr(os, "sched_setaffinity", refused)
    with on_one_core():
        assert cores_of_a_thread() == os.sched_getaffinity(0)


def test_the_switch_interval_is_put_back():
    before = sys.getswitchinterval()
    with undisturbed():
        assert sys.getswitchinterval() == pytest.approx(SWITCH_INTERVAL)
    assert sys.getswitchinterval() == pytest.approx(before)


def test_the_loop_comes_before_the_others_where_real_time_is_permitted():
    reported: list[tuple[str, int, int]] = []

    def run() -> None:
        why = real_time()
        others = os.sched_getparam(0).sched_priority
        first()
        reported.append((why, others, os.sched_getparam(0).sched_priority))

    thread = Thread(target=run)
    thread.start()
    thread.join()
    why, others, loop = reported[0]
    if why:
        assert others == loop == 0, "without real time nothing changes"
    else:
        assert (others, loop) == (PRIORITY, FIRST) and loop > others
    assert os.sched_getscheduler(0) != os.SCHED_FIFO, "only the thread that asked"
