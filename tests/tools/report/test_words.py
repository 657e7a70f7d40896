"""How the sentences of a report begin and end."""

from __future__ import annotations

import pytest

from gritd.tools.report.words import sentence


@pytest.mark.parametrize(
    ("words", "reported"),
    [
        ("torque differs", "Torque differs."),
        ("run-1.mcap was recorded with wheel.radius 0.08.", "run-1.mcap was recorded with"),
        ("runs/at45.mcap: byte 8: no header", "runs/at45.mcap: byte"),
        ("", ""),
    ],
)
def test_a_sentence_leaves_the_name_of_a_file_as_it_is(words: str, reported: str) -> None:
    assert sentence(words).startswith(reported) and sentence(words).endswith("." if words else "")
