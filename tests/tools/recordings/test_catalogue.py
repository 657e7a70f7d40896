"""`gritd runs`: the runs of a folder, filtered and sorted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import gritd
from gritd.estimator.recording.salvage import read
from gritd.tools.cli.command import CommandError
from gritd.tools.commands import replay, runs

STEPS = [{"duration": 3.0, "load": 40.0, "slip": 0.2, "speed": 0.02}]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One run with ticks, one without, in a folder of its own."""
    folder = tmp_path_factory.mktemp("runs")
    (folder / "deep").mkdir()
    raw = folder / "deep" / "raw.mcap"
    gritd.simulate(schedule=STEPS, seed=1).write(str(raw))
    assert replay.main([str(raw), "-o", str(folder / "ticks.mcap")]) == 0
    return folder


def listed(capsys: pytest.CaptureFixture[str], *options: str) -> list[dict[str, Any]]:
    capsys.readouterr()
    assert runs.main([*options, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_each_run_has_what_its_recording_says(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    last = read(folder / "ticks.mcap").arrays("/tick")[-1]
    found = {Path(run["path"]).name: run for run in listed(capsys, str(folder))}
    assert set(found) == {"raw.mcap", "ticks.mcap"}
    assert found["ticks.mcap"]["cohesion"] == last["cohesion"]
    assert found["ticks.mcap"]["tan_phi_sigma"] == last["tan_phi_sigma"]
    assert found["raw.mcap"]["cohesion"] is None
    for run in found.values():
        assert run["testbed"] == "single-wheel testbed" and 2.5 < run["duration"] < 4.0
        assert run["size"] == Path(run["path"]).stat().st_size


def test_filters_and_order(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def names(*options: str) -> list[str]:
        return [Path(run["path"]).stem for run in listed(capsys, str(folder), *options)]

    assert names("--status", "no ticks") == ["raw"]
    assert names("--text", "DEEP") == ["raw"]
    assert names("--rig", "another") == [] and names("--load", "70") == []
    assert len(names("--load", "41")) == 2
    assert names("--sort", "size") == list(reversed(names("--sort", "size", "--reverse")))


def test_parts_of_a_run_are_one_line(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("run.mcap", "run.1.mcap", "other.1.mcap"):
        (tmp_path / name).write_bytes((folder / "ticks.mcap").read_bytes())
    found = {Path(run["path"]).name: run["parts"] for run in listed(capsys, str(tmp_path))}
    assert found == {"run.mcap": 2, "other.1.mcap": 1}


def test_the_table_has_a_line_a_run_and_what_cannot_be_read_is_told(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "good.mcap").write_bytes((folder / "ticks.mcap").read_bytes())
    (tmp_path / "bad.mcap").write_bytes(b"no recording at all, nor ever was")
    capsys.readouterr()
    assert runs.main([str(tmp_path)]) == 3
    out, err = capsys.readouterr()
    assert len(out.splitlines()) == 2 and "good.mcap" in out
    assert "bad.mcap" in err and len(err.splitlines()) == 1


def test_what_is_no_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CommandError) as error:
        runs.main([str(tmp_path / "none")])
    assert error.value.code == 2
