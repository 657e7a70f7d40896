"""`gritd bench` measures what it says, and says it to people and to programs."""

from __future__ import annotations

import json

import pytest

from gritd.estimator.filter.filterpy_engine import FilterpyEngine
from gritd.tools.bench import bench

SMALL = bench.Sizes(seconds=3.0, ticks=300, repeats=1, samples=100, simulated=3.0)
SECTIONS = ("tick", "replay", "forces", "update", "recording", "forward_model")


@pytest.fixture(scope="module")
def figures(tmp_path_factory):
    return bench.measure(SMALL, tmp_path_factory.mktemp("bench"))


def test_every_figure_is_a_positive_number(figures):
    assert tuple(figures) == SECTIONS
    assert all(value > 0.0 for section in figures.values() for value in section.values())


def test_ratios_and_shares_are_those_of_their_parts(figures):
    forces, update, tick = figures["forces"], figures["update"], figures["tick"]
    assert forces["ratio"] == pytest.approx(forces["quadrature"] / forces["closed_form"])
    assert forces["ratio_in_batch"] == pytest.approx(
        forces["quadrature_in_batch"] / forces["closed_form_in_batch"]
    )
    assert update["ratio"] == pytest.approx(update["filterpy"] / update["plain"])
    assert tick["share_of_budget"] == pytest.approx(tick["at_99_percent"] / 0.004)
    assert tick["median"] <= tick["at_99_percent"]


def test_each_replay_runs_the_engine_it_names(tmp_path, monkeypatch):
    applied = []
    honest = FilterpyEngine.update
    monkeypatch.setattr(
        FilterpyEngine, "update", lambda *given: applied.append(1) or honest(*given)
    )
    subject = bench._subject(SMALL, tmp_path)
    monkeypatch.setattr(bench, "ENGINES", ("plain",))
    assert set(bench.replay(subject)) == {"plain_speed", "plain_best"} and not applied
    monkeypatch.setattr(bench, "ENGINES", ("filterpy",))
    bench.replay(subject)
    assert applied


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
