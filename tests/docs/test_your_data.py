"""The page "Your data": its commands run word for word, and every estimate holds the truth."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
import yaml

from gritd.estimator.config.configuration import load
from tests.docs.pages import YOUR_DATA, commands, environment, laid_out

TRUTH = {"c": 1200.0, "tan φ": 0.55, "k": 22.0}  # of strangers.py; Pa, -, mm
DRIVE = {("coulomb_friction", "loss"): 0.3, ("viscous_friction", "damping"): 0.05}
LABORATORIES = ("spreadsheet", "labview", "ros", "matlab")

Said = dict[str, str]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Said]:
    """The folder after the whole page, and what every command printed."""
    folder, said = laid_out(tmp_path_factory.mktemp("your-data"), YOUR_DATA), {}
    for line in commands(YOUR_DATA / "README.md"):
        done = subprocess.run(
            ["bash", "-c", line], cwd=folder, env=environment(), capture_output=True, text=True
        )
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
        said[line] = done.stdout
    return folder, said


@pytest.mark.slow
@pytest.mark.parametrize("name", LABORATORIES)
def test_an_estimate_holds_the_soil_of_the_files(page: tuple[Path, Said], name: str) -> None:
    said = page[1][f"gritd estimate out/{name}/*.mcap"]
    (together,) = re.findall(r"^3 runs together: (.*)$", said, re.MULTILINE)
    for symbol, truth in TRUTH.items():
        found = re.search(rf"{symbol} ([\d.]+) ± ([\d.]+)", together)
        assert found is not None, together
        assert abs(float(found[1]) - truth) < 3.0 * float(found[2]), together


@pytest.mark.slow
def test_the_motor_tells_its_friction(page: tuple[Path, Said]) -> None:
    settings = load(page[0] / "out" / "motor" / "csv.yaml").settings
    effects = {effect.name: effect.parameters for effect in settings.effects}
    for (effect, parameter), truth in DRIVE.items():
        found = effects[effect][parameter]
        assert abs(found.value - truth) < 3.0 * found.sigma < 0.2 * truth


@pytest.mark.slow
@pytest.mark.parametrize("name", [*LABORATORIES, "motor"])
def test_the_proposal_or_one_of_its_choices_is_the_map(page: tuple[Path, Said], name: str) -> None:
    """The carriage of MATLAB, a name of one letter, is asked for."""
    (guess,) = [words for line, words in page[1].items() if f" {name}/" in line and "--g" in line]
    columns = yaml.safe_load((YOUR_DATA / f"{name}.yaml").read_text())["columns"]
    missing = [
        column
        for column, line in columns.items()
        if not re.search(rf"{re.escape(column)}'?: {{channel: {line['channel']}\b", guess)
    ]
    assert missing == []
    assert name != "matlab" or re.search(r"data\.v.*# \?", guess)


@pytest.mark.slow
@pytest.mark.parametrize("name", LABORATORIES)
def test_a_report_is_written(page: tuple[Path, Said], name: str) -> None:
    assert "<h1" in (page[0] / f"{name}.html").read_text(encoding="utf-8")


def test_every_link_of_the_page_leads_somewhere() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", (YOUR_DATA / "README.md").read_text()):
        assert (YOUR_DATA / target).exists(), target
