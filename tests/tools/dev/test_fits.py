"""The comparison of fits with a full bounded optimisation."""

from __future__ import annotations

from pathlib import Path

import pytest

from gritd.tools.dev import fits
from gritd.tools.dev.fits import Compared, FitCase, FitOutcome

pytestmark = pytest.mark.long

OFF = "off by more than 0.5 nats from where the descent ended: "


def _compared(case: FitCase) -> FitOutcome:
    """Two fits of each campaign, the second off where the campaign is the second."""
    gain = 2.0 if case.name.endswith("b") else 0.1
    rows = (
        Compared(case.name, (), 100.0, True, 0.0, 0.0),
        Compared(case.name, ("multipass",), 90.0, True, gain, 0.0),
    )
    return FitOutcome(case.name, rows)


def _campaign(folder: Path, *parts: str) -> None:
    for part in parts or ("",):
        (folder / part).mkdir(parents=True, exist_ok=True)
        (folder / part / "run-1.mcap").touch()
    (folder / "testbed.yaml").touch()


def test_a_stopped_comparison_goes_on_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One campaign alone and one pair; what the file holds is not compared again."""
    _campaign(tmp_path / "a")
    _campaign(tmp_path / "b", "new", "reference")
    rows = tmp_path / "rows.jsonl"
    monkeypatch.setattr(fits, "run_case", _compared)

    fits.main([str(tmp_path / "a"), "--rows", str(rows)])
    assert "1 of 1 campaigns, 2 fits" in capsys.readouterr().out
    first = rows.read_text()

    fits.main([str(tmp_path), "--rows", str(rows)])
    page = capsys.readouterr().out
    assert "2 of 2 campaigns, 4 fits" in page and f"{OFF}1" in page
    assert rows.read_text().startswith(first) and len(rows.read_text().splitlines()) == 2
    (held,) = [o for o in fits.kept(rows) if o.name.endswith("b")]
    assert held.rows[1].names == ("multipass",)


def test_every_deciding_fit_of_a_drawn_campaign_stands_at_its_optimum() -> None:
    outcome = fits.run_case(FitCase(None, 3, 0))
    assert outcome.rows and not outcome.failed
    assert all(row.converged and row.gain < fits.LIMIT for row in outcome.rows)
