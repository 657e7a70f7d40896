"""Work in children: the same results, and errors that reach whoever asks."""

from __future__ import annotations

import os

import numpy as np
import pytest

from gritd.tools.cli import memory
from gritd.tools.cli.parallel import each, meanwhile


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_order(jobs: int) -> None:
    assert each(jobs, lambda x: x * x, [3, 1, 2]) == [9, 1, 4]


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_is_done_meanwhile_is_there_when_asked_for(jobs: int) -> None:
    with meanwhile(jobs, lambda: (os.getpid(), [1.5])) as result:
        process, made = result()
    assert made == [1.5] and (process == os.getpid()) == (jobs == 1)


def test_where_memory_is_scarce_one_process_does_all(monkeypatch: pytest.MonkeyPatch) -> None:
    def pids() -> set[int]:
        with meanwhile(2, os.getpid) as result:
            return {*each(2, lambda _: os.getpid(), [1, 2]), result()}

    assert os.getpid() not in pids()
    monkeypatch.setattr(memory, "_most", lambda: 500_000_000)
    assert pids() == {os.getpid()}


def test_an_error_of_a_child_is_raised_where_its_result_is_asked_for() -> None:
    def fails() -> None:
        raise ValueError("no such thing")

    with meanwhile(2, fails) as result, pytest.raises(ValueError, match="no such thing"):
        result()


def test_a_child_that_is_killed_is_told_and_nobody_waits_for_it() -> None:
    with meanwhile(2, lambda: os._exit(9)) as result, pytest.raises(ChildProcessError):
        result()
    with meanwhile(2, lambda: os.read(os.pipe()[0], 1)):
        pass  # its result is not asked for


def test_a_child_that_ends_is_said_and_not_replaced_for_ever() -> None:
    with pytest.raises(ChildProcessError, match="before its work was done"):
        each(2, lambda item: os._exit(item), [1, 2, 3])


def test_what_is_here_already_comes_back_as_it_is() -> None:
    """And not as a copy: results of many children that hold the same arrays take them once."""
    large = [np.arange(5.0), np.arange(3.0)]
    made = each(2, lambda n: (n, large[1], large[1] + n), [1, 2, 3], large)
    assert [number for number, _, _ in made] == [1, 2, 3]
    assert all(held is large[1] for _, held, _ in made)
    np.testing.assert_array_equal(made[2][2], large[1] + 3)
