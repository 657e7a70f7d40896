"""Counting and sealing, on rows whose score is known by hand."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from gritd.tools.cli.command import CommandError
from gritd.tools.proof.blind import page, score, seal, tables
from gritd.tools.proof.blind.verdicts import Row, Said

NOBODY = Row(
    1, "none", "", (), 0.0, 5.0, frozenset(), 1.0, "consistent", (), 10.0, "", {}, {}, {}, {}
)


def said(name: str, probability: float = 0.8, *others: str, accepted: bool = True) -> Said:
    return Said(name, probability, frozenset((name, *others)), accepted, {})


def single(name: str, *hypotheses: Said, verdict: str = "explained", strong: float = 60.0) -> Row:
    return replace(
        NOBODY, stratum="single", level="strong", truth=(name,), detectability=strong,
        verdict=verdict,
        hypotheses=hypotheses,
    )  # fmt: skip


def test_shares_carry_exact_intervals() -> None:
    none, all_, some = (score.share([True] * k + [False] * (20 - k)) for k in (0, 20, 17))
    assert (none.low, all_.high) == (0.0, 1.0)
    assert none.high == pytest.approx(0.1684, abs=1e-4)  # 1 − 0.025^(1/20)
    assert (some.low, some.high) == pytest.approx((0.6211, 0.9679), abs=1e-4)
    assert (score.share([]).low, score.share([]).high) == (0.0, 1.0)


def test_a_name_is_right_by_itself_by_group_or_by_what_the_campaign_can_tell() -> None:
    exact = single("bed_slope", said("bed_slope"))
    grouped = single("bed_slope", said("force_crosstalk"))
    stated = single("bed_slope", said("bulldozing", 0.8, "bed_slope"))
    blind = replace(single("bed_slope", said("bulldozing")), inseparable=frozenset(("bulldozing",)))

    assert [row.first_right("name") for row in (exact, grouped, stated, blind)] == [
        True,
        False,
        False,
        False,
    ]
    assert [row.first_right("table") for row in (exact, grouped, stated, blind)] == [
        True,
        True,
        False,
        False,
    ]
    assert [row.first_right("engine") for row in (exact, grouped, stated, blind)] == [
        True,
        False,
        True,
        False,
    ]
    assert [row.first_right("plant") for row in (exact, grouped, stated, blind)] == [
        True,
        False,
        False,
        True,
    ]


def test_a_name_without_an_alarm_is_no_hit() -> None:
    quiet = single("bed_slope", said("bed_slope", accepted=False), verdict="consistent")
    assert not quiet.alarmed and not quiet.first_right("table") and not quiet.three_right("table")


def test_counts_by_stratum_and_level() -> None:
    rows = [
        NOBODY,
        replace(NOBODY, verdict="explained", hypotheses=(said("grousers"),), noise_factor=2.0),
        single("bed_slope", said("bed_slope")),
        single("grousers", said("gear_ripple"), said("grousers", 0.1)),
        single("multipass", verdict="consistent", strong=2.0),
        replace(single("cable_drag", verdict="unlisted"), stratum="unlisted"),
    ]
    counted = score.score(rows)
    assert (counted["false_alarms"]["all"]["k"], counted["false_alarms"]["all"]["n"]) == (1, 2)
    assert counted["false_alarms"]["noise as stated"]["k"] == 0

    found = counted["detectable_singles"]
    assert (
        found["first"]["name"]["k"],
        found["first"]["name"]["n"],
        found["three"]["name"]["k"],
    ) == (1, 2, 2)
    assert counted["unlisted"]["recall"]["k"] == 1
    assert counted["confusion"]["grousers"] == {"gear_ripple": 1}

    json.dumps(counted, allow_nan=False)
    text = tables.text(counted, rows)
    assert "grousers strong D=60 → gear_ripple p=0.80" in text


def test_calibration_compares_what_was_stated_with_what_was_right() -> None:
    rows = [single("bed_slope", said("bed_slope", 0.95))] * 3 + [
        single("bed_slope", said("grousers", 0.95))
    ]
    found = score.calibration(rows)["name"]
    top = found["table"][-1]
    assert (top["stated"], top["right"]["k"], top["right"]["n"]) == (pytest.approx(0.95), 3, 4)
    assert found["brier"] == pytest.approx((3 * 0.05**2 + 0.95**2) / 4)


def test_the_page_stands_alone() -> None:
    rows = [NOBODY, single("bed_slope", said("<script>"))]
    text = page.page(score.score(rows), rows, "ab" * 32)
    assert "<script" not in text and "http" not in text and "&lt;script&gt;" in text
    assert "ab" * 32 in text


def test_a_seal_holds_only_for_what_was_sealed(tmp_path: Path) -> None:
    (tmp_path / "truth.npz").write_bytes(b"truth")
    path = tmp_path / "case.json"
    closed = seal.close(
        path, {"effect": "bed_slope"}, {"truth.npz": seal.sha256(tmp_path / "truth.npz")}
    )

    assert seal.opened(path, closed) == {"effect": "bed_slope"}

    again = seal.close(tmp_path / "other.json", {"effect": "bed_slope"})
    assert again != closed  # salted: the same answer cannot be guessed from its seal

    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("bed_slope", "grousers"), encoding="utf-8")
    with pytest.raises(CommandError, match="other answers than were sealed"):
        seal.opened(path, closed)
    path.write_text(text, encoding="utf-8")
    (tmp_path / "truth.npz").write_bytes(b"another")
    with pytest.raises(CommandError, match="another file"):
        seal.opened(path, closed)
