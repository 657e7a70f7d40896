"""`gritd bench` says what it measured to people and to programs."""

from __future__ import annotations

import json

import pytest

from gritd.tools.bench.measure import Sizes, measure
from gritd.tools.commands import bench

SMALL = Sizes(seconds=3.0, ticks=300, repeats=1, samples=100, simulated=3.0)
SECTIONS = ("tick", "replay", "forces", "update", "recording", "forward_model")


@pytest.fixture(scope="module")
def figures(tmp_path_factory):
    return measure(SMALL, tmp_path_factory.mktemp("bench"))


def test_the_report_names_machine_and_every_section(figures):
    lines = bench.report(figures).splitlines()
    assert lines[0].startswith("machine") and "Python" in lines[0]
    for word in ("tick", "replay", "forces", "update", "recording", "simulator", "balance"):
        assert any(line.startswith(word) for line in lines)
    assert max(map(len, lines)) < 140


def test_json_is_one_object_with_the_machine(figures, monkeypatch, capsys):
    monkeypatch.setattr(bench, "measure", lambda sizes, folder: figures)
    assert bench.main(["--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert set(printed) == {"machine", *SECTIONS} and printed["machine"]["cores"] >= 1


def test_a_usage_error_is_one_line(capsys):
    with pytest.raises(SystemExit) as stopped:
        bench.main(["--fast"])
    assert stopped.value.code == 2 and capsys.readouterr().err.count("\n") == 1
