"""The Python of the README runs as it stands, and what it prints is believed."""

from __future__ import annotations

import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from gritd.tools import main as cli
from tests.docs.pages import environment

README = Path(__file__).parents[2] / "README.md"
PYTHON = re.compile(r"^## Python\n\n((?:    .*\n)+)", re.MULTILINE)


def test_the_python_prints_what_replay_believes_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (block,) = PYTHON.findall(README.read_text(encoding="utf-8"))
    monkeypatch.chdir(tmp_path)
    assert cli.main(["init", "bench"]) == 0

    command = [sys.executable, "-c", textwrap.dedent(block)]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr

    capsys.readouterr()
    assert cli.main(["replay", "run.mcap"]) == 0
    replayed = capsys.readouterr().out
    assert "prior" not in done.stdout and "the prior:" not in replayed
    c = re.match(r"c (\d+ ± \d+ Pa)", done.stdout)
    assert c is not None and f"  c          {c[1]}\n" in replayed
