"""The example data and the Python of the README run as they stand, and give the true soil."""

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
EXAMPLE = re.compile(r"^## Example data\n\n((?:    .*\n)+)", re.MULTILINE)
TRUTH = {"c": 1200.0, "tan φ": 0.55}  # as the page says
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


@pytest.mark.long
def test_three_lines_go_from_nothing_to_a_report_with_the_true_soil(tmp_path: Path) -> None:
    (block,) = EXAMPLE.findall(README.read_text(encoding="utf-8"))
    command = ["bash", "-ec", textwrap.dedent(block)]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment(), capture_output=True, text=True, check=True
    )

    (together,) = re.findall(r"^3 runs together: (.*)$", done.stdout, re.MULTILINE)
    for symbol, truth in TRUTH.items():
        found = re.search(rf"{symbol} ([\d.]+) ± ([\d.]+)", together)
        assert found is not None, together
        assert abs(float(found[1]) - truth) < 3.0 * float(found[2]) < 0.15 * truth
    assert "<h1" in (tmp_path / "report.html").read_text(encoding="utf-8")
