"""A stub of a diagnosis shows what the table of halved and doubled numbers says of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from gritd.tools.dev import sensitivity
from gritd.tools.dev.sensitivity import Field, Outcome, changed
from gritd.tools.diagnose.tuning import TUNING

LEVEL, ODDS, KINDS = Field("screen", "level"), Field("search", "odds"), Field("screen", "kinds")


def stub(folder: Path) -> Outcome:
    """Its verdict hangs on the level of the screen, tan φ on the odds, nothing on the kinds."""
    explained = TUNING.screen.level > 0.0075
    tan_phi = 0.5 + TUNING.search.odds
    assert TUNING.screen.sure > 0.0
    verdict, names = ("explained", ("loss",)) if explained else ("consistent", ())
    return Outcome(verdict, names, {"loss": 0.75 if explained else 0.5}, tan_phi, 0.1)


@pytest.fixture
def runs(tmp_path: Path) -> sensitivity.Runs:
    return sensitivity.run([tmp_path / "a"], diagnose=stub)


def test_only_what_a_campaign_reads_is_run(runs: sensitivity.Runs) -> None:
    assert {case.field for case in runs.moved} == {LEVEL, ODDS, KINDS}
    assert len(runs.moved) == 6


def test_the_table_names_the_campaigns_whose_verdict_changes(runs: sensitivity.Runs) -> None:
    lines = sensitivity.page(runs).splitlines()
    row = next(line for line in lines if line.startswith("| `screen.level`"))
    assert row == "| `screen.level` | 0.01 | 2 | 1: a ½ | 1: a ½ | 0.25 | 0.00 |"
    row = next(line for line in lines if line.startswith("| `search.odds`"))
    assert row == "| `search.odds` | 0.15 | 2 | 0 | 0 | 0.00 | 1.50 |"


def test_a_table_that_is_not_finished_says_so(runs: sensitivity.Runs) -> None:
    assert "This table is complete." in sensitivity.page(runs)
    runs.moved = {case: moved for case, moved in runs.moved.items() if case.field == LEVEL}
    page = sensitivity.page(runs)
    assert "partial: 2 of 6 diagnoses" in page
    assert "Not run yet: `screen.kinds`, `search.odds`." in page


def test_time_that_is_up_ends_the_runs(tmp_path: Path) -> None:
    assert len(sensitivity.run([tmp_path / "a"], diagnose=stub, minutes=0.0).moved) == 1


def test_numbers_stay_what_they_are_when_halved_and_doubled() -> None:
    assert changed(0.3, "-", 2.0) == 0.6
    assert (changed(9, "effects", 0.5), changed(1, "effects", 0.5)) == (5, 1)
    assert changed((1.0, 3.0), "s", 0.5) == (0.5, 1.5)
    assert changed({"c": 0.1}, "-", 2.0) == {"c": 0.2}
    assert changed(0.9, "share", 2.0) == pytest.approx(18.0 / 19.0)
    assert changed(0.9, "quantile", 0.5) == pytest.approx(1.0 - 1.0 / 19.0)
    assert changed(0.005, "quantile", 2.0) == pytest.approx(0.00995, rel=1e-3)
