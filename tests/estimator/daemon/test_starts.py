"""A daemon that ends again and again is started more and more slowly, and never given up."""

from __future__ import annotations

import pytest

from gritd.estimator.daemon.starts import NAME, forget, wait_before


def waits(folder, times, runs=1.0, now=100.0):
    """How long each start waits, if the daemon then runs for so long [s]."""
    found = []
    for _ in range(times):
        found.append(wait_before(folder, now))
        now += found[-1] + runs
    return found


def test_from_the_sixth_crash_on_a_start_waits_longer_and_longer(tmp_path):
    assert waits(tmp_path, 13) == [0, 0, 0, 0, 0, 1, 2, 4, 8, 16, 30, 30, 30]


def test_a_daemon_that_ran_for_more_than_a_minute_starts_at_once(tmp_path):
    assert waits(tmp_path, 20, runs=61.0) == [0] * 20
    assert waits(tmp_path, 8, now=1e4)[-1] == 4
    assert wait_before(tmp_path, 2e4) == 0


def test_one_that_was_asked_to_end_starts_at_once(tmp_path):
    waits(tmp_path, 9)
    forget(tmp_path)
    assert waits(tmp_path, 5) == [0] * 5
    forget(tmp_path / "nowhere")


@pytest.mark.parametrize("text", ["", "a b", "7", "9 nan", "99999 100.5", "\x00" * 9])
def test_a_file_of_other_content_stops_nobody(tmp_path, text):
    (tmp_path / NAME).write_text(text)
    assert 0.0 <= wait_before(tmp_path, 101.0) <= 30.0
    assert wait_before(tmp_path / "nowhere", 101.0) == 0.0
