"""How the daemon's threads are scheduled."""

from __future__ import annotations

import os
import sys
from threading import Thread

import pytest

from gritd.estimator.daemon.scheduling import SWITCH_INTERVAL, on_one_core, undisturbed


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
