"""What a file from outside may cost, and how it is changed."""

from __future__ import annotations

import pytest

from gritd.estimator.limits import VARIABLE, Limits, LimitsError, limits


def test_without_the_variable_the_limits_are_those_of_the_page(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert limits() == Limits()


def test_each_can_be_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "text=1 GB, chunks=2e6,")
    assert limits() == Limits(text=1e9, chunks=2e6)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("texts=1 GB", "found 'texts'; expected NAME=VALUE of chunk, chunks,"),
        ("text=big", "text: found 'big'"),
        ("text=1 m", "text: found '1 m'"),
        ("chunks=-1", "chunks: found '-1'"),
        ("chunks", "chunks: found ''"),
        ("ratio=1e999", "ratio: found '1e999'"),
    ],
)
def test_a_mistake_is_one_line(monkeypatch: pytest.MonkeyPatch, text: str, words: str) -> None:
    monkeypatch.setenv(VARIABLE, text)
    with pytest.raises(LimitsError) as error:
        limits()
    assert words in str(error.value) and "\n" not in str(error.value)
