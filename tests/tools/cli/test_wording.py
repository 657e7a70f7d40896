"""Numbers in words."""

from __future__ import annotations

import pytest

from gritd.tools.cli.wording import honesty


@pytest.mark.parametrize(
    ("consistency", "words"),
    [
        (0.1, "σ conservative"),
        (1.0, "σ consistent"),
        (3.0, "σ too small"),
        (30.0, "model disagrees"),
        (float("nan"), "no innovations yet"),
        (None, "no innovations yet"),
    ],
)
def test_consistency_is_told_as_what_it_means_for_sigma(consistency, words):
    assert honesty(consistency) == words
