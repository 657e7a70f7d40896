"""A stub of a diagnosis shows what the table of halved and doubled numbers says of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from gritd.tools.dev.sensitivity import runs as kept
from gritd.tools.dev.sensitivity.numbers import Field, changed
from gritd.tools.dev.sensitivity.outcome import DiagnosisOutcome, Handed
from gritd.tools.dev.sensitivity.page import by_hand, page
from gritd.tools.dev.sensitivity.runs import DiagnosedRuns, run
from gritd.tools.diagnose.tuning import TUNING

LEVEL, ODDS, KINDS = Field("screen", "level"), Field("verdict", "odds"), Field("screen", "kinds")


def stub(folder: Path, handed: Handed) -> DiagnosisOutcome:
    """Its verdict hangs on the level of the screen, tan φ on the odds, nothing on the kinds."""
    explained = TUNING.screen.level > 0.0075
    tan_phi = 0.5 + TUNING.verdict.odds
    assert TUNING.screen.kinds > 0.0
    verdict, names = ("explained", ("loss",)) if explained else ("consistent", ())
    return DiagnosisOutcome(verdict, names, {"loss": 0.75 if explained else 0.5}, tan_phi, 0.1)


def finished(folder: Path, minutes: float = 60.0, only: tuple[str, ...] = ()) -> DiagnosedRuns:
    every = list(run([folder / "a"], folder / "kept.jsonl", only, 2, minutes, stub))
    return every[-1] if every else kept.Kept(folder / "kept.jsonl").runs()


def test_only_what_a_campaign_reads_is_run(tmp_path: Path) -> None:
    runs = finished(tmp_path)
    assert {case.field for case in runs.moved} == {LEVEL, ODDS, KINDS}
    assert len(runs.moved) == 6


def test_the_table_names_the_campaigns_whose_verdict_changes(tmp_path: Path) -> None:
    text = page(finished(tmp_path))
    row = next(line for line in text.splitlines() if line.startswith("| `screen.level`"))
    assert row == "| `screen.level` | 0.01 | 2 | 1: a ½ | 1: a ½ | 0.25 | 0.00 |"
    row = next(line for line in text.splitlines() if line.startswith("| `verdict.odds`"))
    assert row == "| `verdict.odds` | 0.15 | 2 | 0 | 0 | 0.00 | 1.50 |"


def test_what_a_person_wrote_stays(tmp_path: Path) -> None:
    runs = finished(tmp_path)
    written = page(runs).replace("## The table", "## What it shows\n\nMuch.\n\n## The table")
    assert by_hand(page(runs)) == ""
    assert page(runs, shown=by_hand(written)) == written


def test_a_stopped_run_goes_on_where_it_was(tmp_path: Path) -> None:
    finished(tmp_path, only=("screen.level",))
    file = tmp_path / "kept.jsonl"
    before = file.read_text(encoding="utf-8")
    runs = finished(tmp_path)
    assert len(runs.moved) == 6
    after = file.read_text(encoding="utf-8")
    assert after.startswith(before) and after.count('"screen.level", "factor"') == 2

    finished(tmp_path)
    assert file.read_text(encoding="utf-8") == after


def test_time_that_is_up_ends_the_runs(tmp_path: Path) -> None:
    assert finished(tmp_path, minutes=0.0).moved == {}


def test_results_of_another_engine_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    finished(tmp_path)
    monkeypatch.setattr(kept, "engine", lambda: "another")
    with pytest.raises(ValueError, match="another version of the engine"):
        finished(tmp_path)


def test_numbers_stay_what_they_are_when_halved_and_doubled() -> None:
    assert changed(0.3, "-", 2.0) == 0.6
    assert (changed(9, "effects", 0.5), changed(1, "effects", 0.5)) == (5, 1)
    assert changed((1.0, 3.0), "s", 0.5) == (0.5, 1.5)
    assert changed({"c": 0.1}, "-", 2.0) == {"c": 0.2}
    assert changed(0.9, "share", 2.0) == pytest.approx(18.0 / 19.0)
    assert changed(0.9, "quantile", 0.5) == pytest.approx(1.0 - 1.0 / 19.0)
    assert changed(0.005, "quantile", 2.0) == pytest.approx(0.00995, rel=1e-3)
