"""What commands print, whole: a changed word is reviewed once, in `outputs/`."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.wording import commands, errors, live, pages, refusals
from tests.wording.rig import OUTPUTS, text_of

KEPT = Path(__file__).parent / "outputs"
MAKERS = (commands, errors, live, pages, refusals)  # imported: they register what they make


@pytest.mark.parametrize("name", sorted(OUTPUTS))
def test_output_is_the_reviewed_one(
    name: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    found, file = text_of(name, tmp_path), KEPT / f"{name}.txt"
    if request.config.getoption("--rewrite", default=False):
        file.write_text(found, encoding="utf-8")
    assert found == file.read_text(encoding="utf-8"), "to accept: pytest tests/wording --rewrite"


def test_no_snapshot_is_left_over() -> None:
    assert {path.stem for path in KEPT.iterdir()} == set(OUTPUTS)
