"""The summary of a diagnosis in words."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from gritd.tools.diagnose.explain.explanation import _summary


@pytest.mark.parametrize(
    ("names", "groups", "told"),
    [
        (("a",), {}, "a explains 90% of it."),
        (
            ("a",),
            {"a": ("d", "c")},
            "a explains 90% of it. It cannot be told apart from c, d with these recordings.",
        ),
        (
            ("a", "b"),
            {"b": ("c",)},
            "a and b explain 90% of it. b cannot be told apart from c with these recordings.",
        ),
    ],
)
def test_it_says_which_name_has_rivals(
    names: tuple[str, ...], groups: dict[str, tuple[str, ...]], told: str
) -> None:
    decision: Any = SimpleNamespace(
        verdict="explained", best=SimpleNamespace(names=names), groups=groups, share=0.9
    )
    assert _summary(decision, (), 0.003, "Model and recordings") == (
        f"Model and recordings differ (p = 0.003); {told}"
    )
