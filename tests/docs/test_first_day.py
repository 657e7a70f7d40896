"""The tutorial of docs/first-day: its commands run word for word, and do what the page says."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

import gritd
from gritd.estimator.config.configuration import load
from tests.docs.pages import FIRST_DAY, commands, environment, laid_out

TRUE_COHESION, TRUE_TAN_PHI = 1200.0, 0.55  # of stranger.py


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """The folder after the whole day, and what every command printed."""
    folder = laid_out(tmp_path_factory.mktemp("first-day"))
    said = {}
    for line in commands(FIRST_DAY / "README.md"):
        done = subprocess.run(
            ["bash", "-c", line], cwd=folder, env=environment(), capture_output=True, text=True
        )
        unsure = line.startswith("gritd estimate")  # before the friction is known: exit code 1
        assert done.returncode == (1 if unsure else 0), f"{line}\n{done.stdout}{done.stderr}"
        said[line] = done.stdout
    return folder, said


def of(said: dict[str, str], beginning: str) -> list[str]:
    return [words for line, words in said.items() if line.startswith(beginning)]


@pytest.mark.slow
def test_the_calibration_finds_the_true_scale(day: tuple[Path, dict[str, str]]) -> None:
    channels = load(day[0] / "bench" / "testbed.yaml").settings.channels
    for name, scale, offset in (
        ("sinkage_pot", 0.02512, -0.01263),
        ("motor_shunt", 2.013, -5.021),
    ):
        found = channels[name].calibration
        assert abs(found.scale.value - scale) < 3.0 * found.scale.sigma
        assert abs(found.offset.value - offset) < 3.0 * found.offset.sigma
    assert "# zero: the wheel's lowest point" in (day[0] / "bench/testbed.yaml").read_text()


@pytest.mark.slow
def test_the_guess_names_every_column_as_the_map_does(day: tuple[Path, dict[str, str]]) -> None:
    guess, *_ = of(day[1], "gritd import series stranger/*.csv --guess")
    for line in (FIRST_DAY / "map.yaml").read_text().splitlines():
        if match := re.match(r"  (\w+): \{channel: (\w+), unit: ([^,}]+)", line):
            assert f"{match[1]}: {{channel: {match[2]}, unit: {match[3]}" in guess


@pytest.mark.slow
def test_the_import_keeps_who_and_what(day: tuple[Path, dict[str, str]]) -> None:
    runs = gritd.read(sorted(day[0].glob("campaign/*.mcap")))
    assert [run.info.nominal_load for run in runs] == [40.0, 55.0, 70.0, 85.0, 100.0, 115.0]
    assert {run.info.operator for run in runs} == {"A. Stranger"}
    assert all("raked" in run.info.notes for run in runs)


@pytest.mark.slow
def test_the_diagnosis_names_a_friction_of_the_drive(day: tuple[Path, dict[str, str]]) -> None:
    (said,) = of(day[1], "gritd diagnose")
    assert said.startswith("verdict: explained")
    accepted = re.findall(r"^  accepted: (\w+)", said, re.MULTILINE)
    assert accepted and all(name.endswith("_friction") for name in accepted)


@pytest.mark.slow
def test_the_soil_is_the_strangers_once_the_friction_is_known(
    day: tuple[Path, dict[str, str]],
) -> None:
    soil = load(day[0] / "explained.yaml").settings.soil
    for found, truth in ((soil.cohesion, TRUE_COHESION), (soil.tan_phi, TRUE_TAN_PHI)):
        assert abs(found.value - truth) < 3.0 * found.sigma


@pytest.mark.slow
def test_the_reports_begin_with_operator_and_notes(day: tuple[Path, dict[str, str]]) -> None:
    for name in ("diagnosis.html", "campaign.html"):
        page = (day[0] / name).read_text(encoding="utf-8")
        first = page[page.index("<h1") : page.index("Runs</h2>")]
        assert "A. Stranger" in first and "raked and levelled" in first


def test_every_link_of_the_page_leads_somewhere() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", (FIRST_DAY / "README.md").read_text()):
        assert (FIRST_DAY / target).exists(), target
