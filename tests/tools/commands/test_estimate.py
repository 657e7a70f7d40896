"""`gritd estimate`: runs at one load each know little of c and tan φ, and together much."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.messages.run_info import RunInfo
from gritd.estimator.recording.run_writer import RunWriter
from gritd.estimator.recording.topics import TOPICS
from gritd.tools import main as cli
from gritd.tools.commands import simulate
from tests.tools.commands import six_runs

SOIL = {"c": 1250.0, "tan_phi": 0.55}


def made(folder: Path, load: float, *more: str) -> Path:
    slips = "".join(
        f"  - {{duration: 4 s, load: {load} N, slip: {slip}, speed: 20 mm/s}}\n"
        for slip in (0.1, 0.3, 0.5)
    )
    (folder / "s.yaml").write_text(f"segments:\n{slips}")
    path = folder / f"run-{load:g}.mcap"
    soil = [f"--soil=cohesion={SOIL['c']}", f"--soil=tan_phi={SOIL['tan_phi']}", f"--seed={load:g}"]
    assert simulate.main(["--schedule", str(folder / "s.yaml"), "-o", str(path), *soil, *more]) == 0
    return path


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("bed")
    return [made(folder, load) for load in (35, 60, 100)]


def reported(runs: list[Path], out: Path, *more: str) -> dict:
    assert cli.main(["estimate", *map(str, runs), "--json", str(out), *more]) == 0
    return json.loads(out.read_text())


def test_runs_together_know_what_none_knows_alone(runs, tmp_path, capsys):
    found = reported(runs, tmp_path / "out.json")
    for name, truth in SOIL.items():
        value, sigma = found["together"][name]["value"], found["together"][name]["sigma"]
        assert abs(value - truth) < 2.0 * sigma
        assert sigma < min(run["alone"][name]["sigma"] for run in found["runs"]) / 2.5

    said = capsys.readouterr().out
    assert "3 runs together: c" in said and "none stated" in said and "does not fit" not in said


def test_a_stated_repeatability_widens_what_they_know(runs, tmp_path, capsys):
    same = reported(runs, tmp_path / "a.json")["together"]
    options = ["--repeatability", "c=50 Pa", "--repeatability", "tan_phi=0.01"]
    other = reported(runs, tmp_path / "b.json", *options)["together"]
    assert other["c"]["sigma"] > 1.5 * same["c"]["sigma"]
    assert "repeatability between preparations, σ: c 50 Pa" in capsys.readouterr().out


def test_another_configuration_and_a_mistyped_name_are_refused(runs, tmp_path, capsys):
    (tmp_path / "testbed.dbc").write_bytes(packaged("testbed.dbc").read_bytes())
    text = packaged().read_text().replace("sigma: 300 Pa", "sigma: 100 Pa")
    (tmp_path / "other.yaml").write_text(text)
    foreign = made(tmp_path, 50, "--config", str(tmp_path / "other.yaml"))
    assert cli.main(["estimate", str(runs[0]), str(foreign)]) == 2
    assert "run-50.mcap: has another prior" in capsys.readouterr().err

    assert cli.main(["estimate", str(runs[0]), "--repeatability", "tan_fi=0.1"]) == 2
    assert "did you mean tan_phi?" in capsys.readouterr().err


def test_replay_carries_the_posterior_on(runs, capsys):
    assert cli.main(["replay", "--carry", *map(str, runs)]) == 0
    carried = capsys.readouterr().out
    assert carried.count("filter updates") == 3 and "3 runs together" in carried
    assert cli.main(["replay", "--carry", "--verify", str(runs[0])]) == 2


@pytest.mark.parametrize("command", [("estimate",), ("report",), ("replay", "--carry")])
def test_a_recording_without_readings_is_one_line(tmp_path, capsys, command):
    """A daemon that was stopped before its sensors spoke."""
    empty = tmp_path / "empty.mcap"
    RunWriter(empty, TOPICS, config.load(packaged()).text, RunInfo("empty", 60.0)).close()
    out = ("-o", str(tmp_path / "page.html")) if command == ("report",) else ()
    assert cli.main([*command, str(empty), *out]) == 3
    assert capsys.readouterr().err == f"gritd: {empty}: holds no readings\n"


@pytest.mark.long
def test_six_runs_are_three_times_narrower_than_the_best_and_right():
    outcomes = [six_runs.outcome(seed) for seed in range(4)]
    assert sum(each.met for each in outcomes) >= 3
