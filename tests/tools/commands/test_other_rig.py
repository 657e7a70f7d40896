"""A configuration of another testbed is refused by every command that takes one for recordings."""

from __future__ import annotations

from pathlib import Path

import pytest

from gritd.config import packaged
from gritd.tools.main import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """run.mcap of the packaged testbed, and other.yaml with a wheel twice as large."""
    made = tmp_path_factory.mktemp("rigs")
    (made / "brief.yaml").write_text(BRIEF, encoding="utf-8")
    assert main(["simulate", "--schedule", str(made / "brief.yaml"), "-o", f"{made}/run.mcap"]) == 0
    text = packaged().read_text(encoding="utf-8")
    text = text.replace("radius: 72 mm", "radius: 144 mm").replace(
        "dbc: testbed.dbc", f"dbc: {packaged('testbed.dbc')}"
    )
    (made / "other.yaml").write_text(text, encoding="utf-8")
    return made


BRIEF = """
segments:
  - {duration: 6 s, load: 70 N, slip: 30 %, speed: 20 mm/s}
"""


@pytest.mark.parametrize("command", ["replay", "estimate", "compare", "diagnose", "report"])
def test_another_testbeds_configuration_is_refused(
    folder: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    output = ["-o", str(folder / "page.html")] if command == "report" else []
    other = ["--config", str(folder / "other.yaml")]
    assert main([command, str(folder / "run.mcap"), *other, *output]) == 2
    reported = capsys.readouterr().err
    assert (
        "another testbed" in reported
        and "--other-rig" in reported
        and len(reported.splitlines()) == 1
    )
    assert not (folder / "page.html").exists()


@pytest.mark.parametrize("command", ["replay", "estimate", "compare"])
def test_unless_it_is_meant(folder: Path, command: str) -> None:
    other = ["--config", str(folder / "other.yaml"), "--other-rig"]
    assert main([command, str(folder / "run.mcap"), *other]) in (0, 1)
