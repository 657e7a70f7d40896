"""One mistake, one exit code, whichever command meets it (DESIGN 5): 2 for a wrong name, 3 for a
wrong content.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gritd.config import packaged
from gritd.tools import main as cli

CONFIG = ["--config", str(packaged())]
COMMANDS = {
    "replay": lambda file, out: ["replay", file],
    "verify": lambda file, out: ["replay", file, "--verify"],
    "recover": lambda file, out: ["recover", file, "-o", f"{out}.mcap"],
    "simulate": lambda file, out: ["simulate", "--motion", file, "-o", f"{out}.mcap"],
    "import": lambda file, out: ["import", "cmu", file, "-o", out],
    "diagnose": lambda file, out: ["diagnose", file, *CONFIG],
    "compare": lambda file, out: ["compare", file, *CONFIG],
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(("name", "code"), [("none.mcap", 2), ("folder", 3), ("photo.png", 3)])
def test_inputs(
    command: str, name: str, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "photo.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(500))
    (tmp_path / "folder").mkdir()
    assert cli.main(COMMANDS[command](str(tmp_path / name), str(tmp_path / "out"))) == code
    said = capsys.readouterr()
    assert (
        said.err.startswith(f"gritd: {tmp_path / name}: ")
        and said.err.count("\n") == 1
        and said.out == ""
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder", "photo.png"]


@pytest.mark.parametrize(
    "arguments",
    [
        ["simulate", "--seed", "-1", "-o", "x.mcap"],
        ["reproduce", "--seed", "-1"],
        ["diagnose", "x.mcap", *CONFIG, "--seed", "-1"],
        ["demo", "--seed", "-1"],
        ["demo", "--seconds", "nan"],
    ],
)
def test_numbers(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main(arguments)
    said = capsys.readouterr()
    assert stop.value.code == 2 and said.out == ""
    assert "expected a " in said.err and "found '" in said.err
    assert said.err.count("\n") == 1


@pytest.mark.parametrize("buffered", [{}, {"PYTHONUNBUFFERED": "1"}])
def test_an_output_that_is_full_is_one_line_without_a_number(buffered: dict[str, str]) -> None:
    others = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "gritd", "effects"],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False, env=others | buffered,
        )  # fmt: skip
    assert (done.returncode, done.stderr) == (1, "gritd: no space left on device\n")
