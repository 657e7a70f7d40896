"""Lines in the journal: every one once, with its count, and not too many."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.daemon.notice import Notice
from gritd.tools.service.incidents import BURST, OVER, PAUSE, REFILL, Limited, Recurring

LOOK = 0.1  # [s]


def said(totals, what="frames lost"):
    """What is said while a counter takes these values, one a look, and long after."""
    recurring = Recurring(what)
    looks = [*totals, *[totals[-1]] * round((PAUSE + 2 * OVER) / LOOK)]
    notices = [recurring.look(total, LOOK * number) for number, total in enumerate(looks)]
    return [notice for notice in notices if notice is not None]


@given(st.lists(st.integers(0, 5), min_size=1, max_size=400))
def test_no_fault_is_left_uncounted_and_lines_are_few(steps):
    """Of every count the last line about it says all."""
    totals = [sum(steps[: n + 1]) for n in range(len(steps))]
    lines = said(totals)
    counted, pending = 0, 0
    for line in lines:
        numbers = [int(word.rstrip(",")) for word in line.text.split() if word[0].isdigit()
                   and "." not in word]  # fmt: skip
        if line.over:
            counted, pending = counted + numbers[-1], 0
        elif "in all" in line.text:
            pending = numbers[-1]
        else:
            counted, pending = counted + pending, numbers[0]
    assert counted + pending == totals[-1]
    assert len(lines) <= 2 + 2 * (len(totals) * LOOK) / OVER


def test_lines_about_one_subject_are_limited_and_the_last_one_stands():
    limited, heard = Limited(), []
    for number in range(1000):  # fifty a second
        limited.offer(Notice(f"line {number}"))
        heard += filter(None, [limited.due(0.02 * number)])
    assert len(heard) <= BURST + 20.0 / REFILL + 1
    heard += filter(None, [limited.due(1000.0)])
    assert heard[-1].text.startswith("line 999 (")
    left_out = sum(int(n.text.split("(")[1].split()[0]) for n in heard if "(" in n.text)
    assert len(heard) + left_out == 1000


def test_a_line_now_and_then_is_never_left_out():
    limited = Limited()
    for number in range(1000):
        limited.offer(Notice("here", over=True))
        assert limited.due(2.0 * number) == Notice("here", over=True)


@pytest.mark.parametrize("total", [0, 7])
def test_what_was_counted_before_is_no_news(total):
    assert Recurring("frames lost", total).look(total, 0.0) is None
