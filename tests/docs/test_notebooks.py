"""The notebooks of docs/first-day run from the first cell to the last."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.pages import FIRST_DAY, environment, laid_out, program

NOTEBOOKS = sorted(FIRST_DAY.glob("*.ipynb"))


def test_there_are_two() -> None:
    assert [notebook.name for notebook in NOTEBOOKS] == ["arrays.ipynb", "csv.ipynb"]


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_output(notebook: Path) -> None:
    """Output belongs to whoever ran it: it would hold times and paths."""
    document = json.loads(notebook.read_text(encoding="utf-8"))
    assert document["nbformat"] == 4
    assert len({cell["id"] for cell in document["cells"]}) == len(document["cells"])
    for cell in document["cells"]:
        assert cell["cell_type"] == "markdown" or not cell["outputs"]


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(notebook: Path, tmp_path: Path) -> None:
    laid_out(tmp_path)
    command = [sys.executable, "-c", program(notebook)]
    done = subprocess.run(command, cwd=tmp_path, env=environment(), capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    if notebook.stem == "csv":
        assert "verdict: explained" in done.stdout and "html of" in done.stdout
        assert "A. Stranger" in (tmp_path / "report.html").read_text(encoding="utf-8")
    else:
        assert done.stdout.count(" ± ") >= 6  # c, tan φ and k, after one run and after two
