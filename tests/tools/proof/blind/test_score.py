"""Counting and sealing, on rows whose score is known by hand."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gritd.tools.cli.command import CommandError
from gritd.tools.proof.blind import calibration, page, score, score_worlds, seal, shares, tables
from gritd.tools.proof.blind.plant.worlds import HELD
from gritd.tools.proof.blind.verdicts import CaseRow, StatedHypothesis

NOBODY = CaseRow(
    number=1,
    stratum="none",
    level="",
    world="paper",
    bed="",
    held=frozenset(),
    truth=(),
    detectability=0.0,
    limit=5.0,
    inseparable=frozenset(),
    noise_factor=1.0,
    verdict="consistent",
    hypotheses=(),
    seconds=10.0,
    note="",
    soil={},
    parameters={},
    heldout={},
    refit={},
)


def said(
    name: str, probability: float = 0.8, *others: str, accepted: bool = True
) -> StatedHypothesis:
    return StatedHypothesis(name, probability, frozenset((name, *others)), accepted, {})


def single(
    name: str, *hypotheses: StatedHypothesis, verdict: str = "explained", strong: float = 60.0
) -> CaseRow:
    return replace(
        NOBODY,
        stratum="single",
        level="strong",
        truth=(name,),
        detectability=strong,
        verdict=verdict,
        hypotheses=hypotheses,
    )


def pair(row: CaseRow, world: str = "strips", bed: str = "prepared") -> CaseRow:
    return replace(row, stratum="pair", world=world, bed=bed)


def counts(of: dict[str, Any]) -> tuple[int, int]:
    return of["k"], of["n"]


def test_shares_carry_exact_intervals() -> None:
    none, all_, some = (shares.share([True] * k + [False] * (20 - k)) for k in (0, 20, 17))
    assert (none.low, all_.high) == (0.0, 1.0)
    assert none.high == pytest.approx(0.1684, abs=1e-4)  # 1 − 0.025^(1/20)
    assert (some.low, some.high) == pytest.approx((0.6211, 0.9679), abs=1e-4)
    assert (shares.share([]).low, shares.share([]).high) == (0.0, 1.0)


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
    named = {name: counts(of["first"]["name"]) for name, of in counted["strata"].items()}
    assert named["single"] == (1, 3)
    assert named["none"] == named["unlisted"] == (0, 0)  # there is nothing that has a name

    json.dumps(counted, allow_nan=False)
    text = tables.text(counted, rows)
    assert "grousers strong D=60 → gear_ripple p=0.80" in text


def test_calibration_compares_what_was_stated_with_what_was_right() -> None:
    rows = [single("bed_slope", said("bed_slope", 0.95))] * 3 + [
        single("bed_slope", said("grousers", 0.95))
    ]
    found = calibration.calibration(rows)["name"]
    top = found["table"][-1]
    assert (top["stated"], top["right"]["k"], top["right"]["n"]) == (pytest.approx(0.95), 3, 4)
    assert found["brier"] == pytest.approx((3 * 0.05**2 + 0.95**2) / 4)


def test_a_companion_is_false_where_it_is_neither_there_nor_like_what_is() -> None:
    rows = [
        single("soil_patch", said("soil_patch"), said("pulley_slip")),
        single("soil_patch", said("soil_patch"), said("pulley_slip", 0.5, "soil_patch")),
        single("bed_slope", said("bed_slope"), said("force_crosstalk")),
        single("bed_slope", said("bed_slope"), said("pulley_slip", accepted=False)),
        single("bed_slope", said("grousers")),  # wrong, but alone
        replace(
            single("bed_slope", said("bed_slope"), said("grousers")),
            stratum="two",
            truth=("bed_slope", "grousers"),
        ),
    ]
    found = score.score(rows)["companions"]
    assert counts(found["table"]) == (2, 6)
    assert counts(found["engine"]) == (1 + 1, 6)  # force_crosstalk was not stated to be like it


def test_both_of_two_are_named_by_name_or_by_group() -> None:
    def two(*hypotheses: StatedHypothesis) -> CaseRow:
        one = single("bed_slope", *hypotheses)
        return replace(one, stratum="two", truth=("bed_slope", "grousers"))

    rows = [
        two(said("bed_slope"), said("grousers")),
        two(said("force_crosstalk"), said("grousers")),
        two(said("bed_slope"), said("force_crosstalk")),
        two(said("grousers", 0.9), said("bed_slope", 0.2, accepted=False)),
    ]
    found = score.score(rows)["two"]
    assert counts(found["both named"]) == (1, 4)
    assert counts(found["both named by group"]) == (2, 4)
    assert counts(found["one named"]) == (4, 4)


def test_both_of_two_are_asked_for_where_each_alone_is_seen_in_the_same_campaign() -> None:
    both = replace(
        single("bed_slope", said("bed_slope"), said("grousers")),
        stratum="two",
        truth=("bed_slope", "grousers"),
    )
    first, second = single("bed_slope", said("bed_slope")), single("grousers", said("grousers"))
    rows = [
        replace(both, alone=(first, second)),
        replace(both, alone=(first, second), hypotheses=(said("bed_slope"),)),
        replace(both, alone=(first, single("grousers", verdict="unlisted"))),
        replace(both, alone=(first, single("grousers", verdict="consistent"))),
        both,
    ]
    found = score.score(rows)["two"]
    assert counts(found["both named where each alone is"]) == (1, 2)
    assert counts(found["both named where each alone alarms"]) == (2, 3)
    assert counts(found["both named by group"]) == (4, 5)


def test_sure_names_count_whether_first_or_not() -> None:
    rows = [
        single("bed_slope", said("bed_slope", 0.96), said("grousers", 0.91)),
        single("bed_slope", said("force_crosstalk", 0.95), said("multipass", 0.5)),
        single("bed_slope", said("bed_slope", 0.95, accepted=False), verdict="unlisted"),
    ]
    found = score.score(rows)["accepted"]
    assert counts(found["name"]["sure"]) == (1, 3)
    assert counts(found["table"]["sure"]) == (2, 3)
    assert [one["right"]["n"] for one in found["name"]["table"]] == [0, 0, 1, 0, 0, 3]


def test_false_alarms_are_counted_by_what_is_awkward_and_at_home_alone() -> None:
    awkward = replace(NOBODY, stratum="awkward", level="load measured")
    alarmed = {"verdict": "explained", "hypotheses": (said("grousers"),)}
    rows = [
        NOBODY,
        awkward,
        replace(awkward, **alarmed),
        replace(awkward, level="one run", verdict="unlisted"),
        replace(NOBODY, stratum="foreign", world="strips", **alarmed),
        pair(replace(NOBODY, **alarmed)),
    ]
    found = score.score(rows)["false_alarms"]
    assert counts(found["all"]) == (2, 4)
    assert counts(found["awkward"]["load measured"]) == (1, 2)
    assert counts(found["awkward"]["one run"]) == (1, 1)
    assert counts(found["awkward"]["no wrench"]) == (0, 0)


def test_pairs_are_counted_by_world_and_bed() -> None:
    rows = [
        pair(NOBODY),
        pair(replace(NOBODY, verdict="unlisted", reference_verdict="unlisted"), bed="same"),
        pair(single("bed_slope", said("bed_slope"), said("grousers"))),
        pair(single("bed_slope", said("multipass")), world="gear", bed="same"),
        pair(single("cable_drag", verdict="unlisted")),
        pair(single("bed_slope", verdict="consistent", strong=1.0)),  # nobody could see it
    ]
    found = score_worlds.pairs(rows)
    assert counts(found["all"]["false alarms"]) == (1, 2)
    assert counts(found["all"]["first"]["name"]) == (1, 2)
    assert counts(found["strips"]["first"]["name"]) == (1, 1)
    assert counts(found["gear"]["first"]["name"]) == (0, 1)
    assert counts(found["all"]["false companion"]) == (1, 2)
    assert counts(found["all"]["unlisted"]) == (1, 1)
    assert counts(found["same bed"]["false alarms"]) == (1, 1)
    assert counts(found["reference unlisted"]["false alarms"]) == (1, 1)


def test_a_foreign_worlds_own_names_are_true_of_it_but_not_new_in_it() -> None:
    own = frozenset(HELD["gear"])
    alone = replace(
        NOBODY,
        stratum="foreign",
        world="gear",
        held=own,
        verdict="explained",
        hypotheses=(said("gear_ripple"), said("multipass")),
    )
    found = score_worlds.foreign([alone, replace(alone, verdict="unlisted")])["gear"]
    assert counts(found["first name true"]) == (1, 1)
    assert counts(found["false companion"]) == (1, 1)
    assert counts(found["verdicts"]["unlisted"]) == (1, 2)
    new = score_worlds.pairs([pair(replace(alone, held=frozenset()), world="gear")])["gear"]
    assert counts(new["false alarms"]) == (1, 1)


def test_soil_that_is_said_to_be_unknown_counts_apart() -> None:
    def stated(z: float) -> CaseRow:
        one = {"before": 0.1, "after": 0.1, "z_before": 0.5, "z_after": z}
        return replace(NOBODY, soil={"c": one, "tan_phi": one})

    rows = [stated(z) for z in (0.5, -1.5, 3.0, math.nan)]
    found = score_worlds.soil(rows)["c"]
    assert counts(found["within one sigma after"]) == (1, 3)
    assert counts(found["within two sigma after"]) == (2, 3)
    assert counts(found["unknown after"]) == (1, 4)
    assert counts(found["within one sigma before"]) == (4, 4)


def test_every_table_has_its_heading_and_no_ragged_row() -> None:
    rows = [
        NOBODY,
        single("bed_slope", said("bed_slope")),
        pair(single("bed_slope", said("bed_slope"))),
        replace(NOBODY, stratum="foreign", world="gear", held=frozenset(HELD["gear"])),
    ]
    counted = score.score(rows)
    json.dumps(counted, allow_nan=False)
    for heading, table in tables.all_tables(counted).items():
        assert len({len(row) for row in table}) == 1, heading
    text = page.page(counted, rows, "ab" * 32)
    for heading in ("A reference campaign, then a new one", "Campaigns alone in foreign worlds"):
        assert f"<h2>{heading}</h2>" in text


def test_what_no_case_asks_is_not_shown() -> None:
    counted = score.score([pair(single("bed_slope", said("bed_slope")))])
    shown = tables.all_tables(counted)
    assert not [row for t in shown.values() for row in t if set(row[1:]) <= {tables.NONE}]
    assert "A reference campaign, then a new one" in shown
    assert "Campaigns alone in foreign worlds" not in shown


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
