"""`gritd bench` says what it measured to people and to programs."""

from __future__ import annotations

import json
from copy import deepcopy

import pytest

from gritd.tools.bench.compare import comparison, is_ratio, ratios
from gritd.tools.cli.command import CommandError
from gritd.tools.commands import bench
from tests.tools.bench.samples import FIGURES


@pytest.fixture
def figures():
    return deepcopy(FIGURES)


def test_the_report_names_machine_and_every_section(figures):
    lines = bench.report(figures).splitlines()
    assert lines[0].startswith("machine") and "Python" in lines[0]
    words = ("tick", "replay", "forces", "update", "recording", "simulator", "balance")
    for word in (*words, "reading", "writing", "start", "live"):
        assert any(line.startswith(word) for line in lines)
    assert max(map(len, lines)) < 180


def test_json_is_one_object_with_the_machine(figures, monkeypatch, capsys):
    monkeypatch.setattr(bench, "measure", lambda sizes, folder: figures)
    assert bench.main(["--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert set(printed) == {"machine", *FIGURES} and printed["machine"]["cores"] >= 1


def test_a_usage_error_is_one_line(capsys):
    with pytest.raises(SystemExit) as stopped:
        bench.main(["--fast"])
    assert stopped.value.code == 2 and capsys.readouterr().err.count("\n") == 1


def changed(figures, factor):
    """The figures with every ratio so many times what it was."""
    return {
        section: {n: v * factor if is_ratio(n) else v for n, v in values.items()}
        for section, values in figures.items()
    }


@pytest.mark.parametrize("factor, code", [(1.0, 0), (1.2, 0), (1.3, 1)])
def test_a_ratio_that_is_worse_by_a_fifth_fails_and_is_named(
    figures, factor, code, tmp_path, monkeypatch, capsys
):
    old = tmp_path / "old.json"
    old.write_text(json.dumps({"machine": {}, **changed(figures, factor)}))
    monkeypatch.setattr(bench, "measure", lambda sizes, folder: figures)

    assert bench.main(["--compare", str(old)]) == code
    said = capsys.readouterr().out
    assert "reading.over_rosbags: " in said and ("WORSE" in said) == bool(code)

    assert bench.main(["--json", "--compare", str(old)]) == code
    json.loads(capsys.readouterr().out)  # the comparison stands elsewhere


def test_a_figure_that_is_missing_now_is_said_and_fails_nothing(figures):
    before = ratios(figures) | {"reading.over_another": 3.0}
    lines, failed = comparison(before, ratios(figures))
    assert any("reading.over_another" in line for line in lines) and not failed


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"tick": {"over_plain_loop": "fast"}}'])
def test_what_is_no_earlier_run_is_one_line(text, tmp_path):
    old = tmp_path / "old.json"
    old.write_text(text)
    with pytest.raises(CommandError, match=r"found no ratios; expected the output of --json"):
        bench.main(["--compare", str(old)])
    with pytest.raises(CommandError, match="No such file"):
        bench.main(["--compare", str(tmp_path / "none.json")])


@pytest.mark.parametrize(
    ("name", "ratio"),
    [
        ("over_rosbags", True),
        ("balance_ratio_to_8_nodes", True),
        ("duration_median", False),  # a shorter duration is no loss
        ("lateness_worst", False),
    ],
)
def test_what_is_a_ratio(name, ratio):
    assert is_ratio(name) == ratio
