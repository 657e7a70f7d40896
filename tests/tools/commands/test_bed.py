"""`gritd bed`: the options stand before or behind the word."""

from __future__ import annotations

from pathlib import Path

import pytest

from gritd.tools.commands.bed import main


@pytest.mark.parametrize("before", [True, False])
def test_a_bed_is_begun_and_shown(
    tmp_path: Path, before: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    place = ["--directory", str(tmp_path / "logs")]

    def command(*words: str) -> list[str]:
        return [*place, *words] if before else [*words, *place]

    assert main(command("new", "sand-7")) == 0
    assert "bed 'sand-7', 0 runs" in capsys.readouterr().out
    assert main(command("show")) == 0
    assert "bed 'sand-7', 0 runs" in capsys.readouterr().out
