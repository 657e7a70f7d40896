"""`gritd example`: a campaign to try the other commands on, the same every time."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import gritd
from gritd.tools import main as cli

TRUTH = {"c": 1200.0, "tan_phi": 0.55}  # as it says


def test_three_lines_go_to_a_report_with_the_soil_of_the_example(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["example", "campaign"]) == 0
    assert "c 1200 Pa, tan φ 0.55" in capsys.readouterr().out

    runs = sorted(str(path) for path in Path("campaign").glob("run-*.mcap"))
    assert cli.main(["estimate", *runs, "--json", "estimate.json"]) == 0
    assert cli.main(["report", *runs, "-o", "report.html"]) == 0
    assert "<h1" in Path("report.html").read_text(encoding="utf-8")

    together = json.loads(Path("estimate.json").read_text())["together"]
    for name, truth in TRUTH.items():
        found = together[name]
        assert abs(found["value"] - truth) < 3.0 * found["sigma"] < 0.15 * truth


def test_it_is_the_same_every_time_and_takes_no_file_s_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("one", "two"):
        assert (
            cli.main(["example", str(tmp_path / name), "--effect", "slip_sinkage.growth=0.2"]) == 0
        )
    first, second = (gritd.read(tmp_path / name / "run-070N.mcap") for name in ("one", "two"))
    assert np.array_equal(first["raw/motor_shunt"], second["raw/motor_shunt"])

    assert cli.main(["example", str(tmp_path / "one")]) == 2
    assert "is there already" in capsys.readouterr().err
    assert cli.main(["example", str(tmp_path / "three"), "--effect", "nothing.gain=1"]) == 2
    assert not (tmp_path / "three").exists()
