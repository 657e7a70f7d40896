"""Text from outside, fit to be shown."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.estimator.visible import visible


@given(st.text(st.characters(exclude_categories=())))
def test_nothing_remains_that_a_terminal_obeys(text: str) -> None:
    assert visible(text).isprintable()


@given(st.text().filter(str.isprintable))
def test_what_can_be_read_stays_as_it_is(text: str) -> None:
    assert visible(text) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("sand\x1b[2J", r"sand\x1b[2J"),
        ("a\rb\nc\td", r"a\rb\nc\td"),
        ("\x9b31m", r"\x9b31m"),
        ("\u202egnp.exe", r"\u202egnp.exe"),
        ("\udc80", r"\udc80"),
        ("θ₁ 70 N·m – 5 %", "θ₁ 70 N·m – 5 %"),
    ],
)
def test_what_cannot_is_written_as_an_escape(text: str, shown: str) -> None:
    assert visible(text) == shown
