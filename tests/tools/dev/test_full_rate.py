"""The tool that tells what batches show at full rate."""

from __future__ import annotations

from gritd.tools.dev.full_rate import lines_of_nothing


def test_nothing_has_no_line() -> None:
    assert lines_of_nothing(0) == ()
