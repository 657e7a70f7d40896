"""The score as text, for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gritd.tools.proof.blind.plant.concealed import UNLISTED
from gritd.tools.proof.blind.verdicts import CaseRow

Table = list[tuple[str, ...]]  # rows of cells, all as long as the first
GAP = "  "
NONE = "–"  # what no case asks


def text(score: Mapping[str, Any], rows: Sequence[CaseRow]) -> str:
    """All tables, then what went wrong, case by case."""
    parts = [f"{heading}\n\n{aligned(table)}" for heading, table in all_tables(score).items()]
    wrong = [f"  {row.number:4}  {explained(row)}" for row in rows if missed(row)]
    return "\n\n".join([*parts, "\n".join(["What went wrong", "", *wrong])] if wrong else parts)


def all_tables(score: Mapping[str, Any]) -> dict[str, Table]:
    """By heading; rows of which no case of the batch asks are left out, and tables without one."""
    tables = {
        "Figures": headline(score),
        "By stratum and strength": strata(score),
        "Stated probability, and how often it was right": reliability(score),
        "All accepted names": accepted(score["accepted"]),
        "Soil: median error": soil(score),
        "Soil: how often sigma covers the truth": coverage(score["soil"]),
        "A reference campaign, then a new one": pairs(score["pairs"]),
        "All names accepted as new": accepted(score["pairs"].get("all", {}).get("accepted", {})),
        "Tables of steady states: a reference wheel, then a new one": pairs(score["tables"]),
        "Soil of the new table": coverage({n: of["soil"] for n, of in score["tables"].items()}),
        "Soil of the new campaign": coverage({n: of["soil"] for n, of in score["pairs"].items()}),
        "Campaigns alone in foreign worlds": foreign(score["foreign"]),
        "Soil in foreign worlds": coverage({n: of["soil"] for n, of in score["foreign"].items()}),
    }

    asked = {heading: _asked(table) for heading, table in tables.items()}
    return {heading: table for heading, table in asked.items() if len(table) > 1}


def _asked(table: Table) -> Table:
    """Without what no case asks; a row stays where one that is set in below it does."""
    kept: Table = []
    for row in reversed(table):
        above = bool(kept) and kept[-1][0].startswith(" ") and not row[0].startswith(" ")
        if above or any(cell != NONE for cell in row[1:]):
            kept.append(row)
    return kept[::-1]


def aligned(table: Table) -> str:
    """Columns as wide as their widest cell."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = (
        GAP.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        for row in table
    )
    return "\n".join(line.rstrip() for line in lines)


def share_text(share: Mapping[str, Any]) -> str:
    """`17/20 85 % (62–97)`; nothing where nothing was asked."""
    if not share["n"]:
        return NONE
    value = share["k"] / share["n"]
    bounds = f"({100 * share['low']:.0f}–{100 * share['high']:.0f})"
    return f"{share['k']}/{share['n']} {value:.0%} {bounds}"


def number(value: float | None, form: str = ".2f") -> str:
    return NONE if value is None else format(value, form)


def headline(score: Mapping[str, Any]) -> Table:
    """What a batch comes to. Foreign worlds and pairs have tables of their own."""
    return [
        ("cases, of which failed", share_text(score["failed"])),
        *_alarms(score["false_alarms"]),
        *_named(score),
        ("parameters within two sigma", share_text(score["parameters"]["within two sigma"])),
        *_held_out(score["heldout"]),
        ("Brier score, by name", number(score["calibration"]["name"]["brier"], ".3f")),
        ("  by the group it states", number(score["calibration"]["engine"]["brier"], ".3f")),
        ("a diagnosis takes, median", f"{number(score['seconds']['median'], '.0f')} s"),
        ("  of a pair", f"{number(score['seconds of pairs']['median'], '.0f')} s"),
    ]


def _alarms(alarms: Mapping[str, Any]) -> Table:
    return [
        ("false alarms", share_text(alarms["all"])),
        ("  noise as stated", share_text(alarms["noise as stated"])),
        ("  noise off by two", share_text(alarms["noise misstated"])),
        *((f"  {way}", share_text(of)) for way, of in alarms["awkward"].items()),
    ]


def _named(score: Mapping[str, Any]) -> Table:
    singles, two, unlisted = score["detectable_singles"], score["two"], score["unlisted"]
    first, companions, sure = singles["first"], score["companions"], score["accepted"]
    usual = score["usual_singles"]

    return [
        ("detectable single effects: detected", share_text(singles["detected"])),
        ("  first name right", share_text(first["name"])),
        ("  … by the fixed groups", share_text(first["table"])),
        ("  … by the group it states", share_text(first["engine"])),
        ("  … by what the campaign can tell", share_text(first["plant"])),
        ("  among the first three, by the fixed groups", share_text(singles["three"]["table"])),
        ("single effects of usual strength: detected", share_text(usual["detected"])),
        ("  first name right, by the fixed groups", share_text(usual["first"]["table"])),
        ("a further name that is not there, by the fixed groups", share_text(companions["table"])),
        ("  … nor in the group it is stated with", share_text(companions["engine"])),
        ("names stated with 0.9 or more that are right", share_text(sure["name"]["sure"])),
        ("  … by the fixed groups", share_text(sure["table"]["sure"])),
        ("  … by the group it states", share_text(sure["engine"]["sure"])),
        ("two effects: one named", share_text(two["one named"])),
        ("  both named", share_text(two["both named"])),
        ("  both named, by the fixed groups", share_text(two["both named by group"])),
        ("  … where each alone is named", share_text(two["both named where each alone is"])),
        ("  … where each alone alarms", share_text(two["both named where each alone alarms"])),
        ("effect outside the list: called unlisted", share_text(unlisted["recall"])),
        ("  given a listed name above 0.5", share_text(unlisted["listed name above one half"])),
    ]


def _held_out(heldout: Mapping[str, Any]) -> Table:
    right = heldout["named right"]
    return [
        ("held-out error over oracle, median", _median(heldout["detectable"]["over fitted"])),
        ("  where nothing is concealed", _median(heldout["none"]["over fitted"])),
        ("  where the name is right", _median(right["over fitted"])),
        ("  … over the noiseless truth", _median(right["over truth"])),
    ]


def _median(of: Mapping[str, Any]) -> str:
    return number(of["median"])


def strata(score: Mapping[str, Any]) -> Table:
    """Alarms and names by stratum and strength."""
    head = (
        "stratum",
        "alarm",
        "first name",
        "first, fixed groups",
        "first, stated group",
        "three, fixed groups",
    )

    rows = [
        (name, *(share_text(cell) for cell in _cells(of))) for name, of in score["strata"].items()
    ]
    return [head, *rows]


def _cells(of: Mapping[str, Any]) -> tuple[Mapping[str, Any], ...]:
    first = of["first"]
    return of["detected"], first["name"], first["table"], first["engine"], of["three"]["table"]


def reliability(score: Mapping[str, Any]) -> Table:
    """Stated probability of the first name against how often it, or the group it was stated with,
    was right.
    """
    by_name, by_group = (score["calibration"][by]["table"] for by in ("name", "engine"))

    rows = [
        (
            f"{one['from']:.1f}-{one['to']:.1f}",
            number(one["stated"]),
            share_text(one["right"]),
            share_text(group["right"]),
        )
        for one, group in zip(by_name, by_group, strict=True)
    ]
    return [("stated probability", "mean", "name right", "stated group right"), *rows]


def accepted(of: Mapping[str, Any]) -> Table:
    """The same of every name that is accepted, first or not."""
    kinds = [of[by]["table"] for by in ("name", "table", "engine") if by in of]
    rows = [
        (
            f"{bins[0]['from']:.1f}-{bins[0]['to']:.1f}",
            number(bins[0]["stated"]),
            *(share_text(one["right"]) for one in bins),
        )
        for bins in zip(*kinds, strict=True)
    ]

    head = ("stated probability", "mean", "name right", "fixed groups", "stated group")
    return [head, *rows]


def soil(score: Mapping[str, Any]) -> Table:
    """Median relative error of c and tan φ before and after."""
    head = ("concealed", "c before", "c after", "tan φ before", "tan φ after")
    rows = [
        (group, *_errors(of["c"]), *_errors(of["tan_phi"]))
        for group, of in score["soil"].items()
        if of["c"]["after"]["n"]
    ]

    return [head, *rows]


def _errors(of: Mapping[str, Any]) -> tuple[str, str]:
    before, after = (number(of[when]["median"], ".1%") for when in ("before", "after"))
    return before, after


def coverage(groups: Mapping[str, Any]) -> Table:
    """How often one and two sigma cover c and tan φ; what is said to be unknown counts apart."""
    head = ("", "", "1σ before", "2σ before", "1σ after", "2σ after", "unknown after")
    rows = [
        (group, symbol, *_covered(of[name]))
        for group, of in groups.items()
        for name, symbol in (("c", "c"), ("tan_phi", "tan φ"))
        if of[name]["unknown after"]["n"]
    ]
    return [head, *rows]


def _covered(of: Mapping[str, Any]) -> tuple[str, ...]:
    within = (
        share_text(of[f"within {many} sigma {when}"])
        for when in ("before", "after")
        for many in ("one", "two")
    )
    return (*within, share_text(of["unknown after"]))


def pairs(groups: Mapping[str, Any]) -> Table:
    """What is said to be new: alarms where nothing is, names where an effect is."""
    head = (
        "world",
        "false alarms",
        "detected",
        "first, fixed groups",
        "first, stated group",
        "further name not there",
        "0.9 or more, stated group",
        "outside the list: called unlisted",
        "over truth",
    )

    return [head, *((name, *_new(of)) for name, of in groups.items())]


def _new(of: Mapping[str, Any]) -> tuple[str, ...]:
    shares = (
        of["false alarms"],
        of["detected"],
        of["first"]["table"],
        of["first"]["engine"],
        of["false companion"],
        of["accepted"]["engine"]["sure"],
        of["unlisted"],
    )
    return (*map(share_text, shares), _median(of["over truth"]))


def foreign(groups: Mapping[str, Any]) -> Table:
    """Verdicts in foreign worlds, and how true the names are that were given there."""
    head = (
        "world",
        "consistent",
        "explained",
        "unlisted",
        "first name true",
        "further name not there",
        "concealed effect first",
    )

    return [head, *((name, *_alone(of)) for name, of in groups.items())]


def _alone(of: Mapping[str, Any]) -> tuple[str, ...]:
    verdicts = (of["verdicts"][verdict] for verdict in ("consistent", "explained", "unlisted"))
    rest = (of["first name true"], of["false companion"], of["concealed first"])
    return tuple(map(share_text, (*verdicts, *rest)))


def missed(row: CaseRow) -> bool:
    """Not what should have been said: an alarm without cause, or a cause without its name."""
    if row.verdict == "failed":
        return True
    if not row.truth:
        return row.alarmed and not row.held
    if row.truth[0] in UNLISTED:
        return row.verdict != "unlisted"
    return not (row.first_right("table") or row.first_right("engine"))


def explained(row: CaseRow) -> str:
    """One line: truth and strength, what was said, and why it may be."""
    parts = [
        f"{_truth(row)} → {_spoken(row)}",
        f"the campaign cannot tell it from {', '.join(sorted(row.inseparable))}"
        if row.inseparable
        else "",
        f"stated noise × {row.noise_factor:g}" if row.noise_factor != 1.0 else "",
        row.note[:160] if row.verdict in ("failed", "insufficient") else "",
    ]
    return "; ".join(part for part in parts if part)


def _truth(row: CaseRow) -> str:
    truth = " + ".join(row.truth) or "none"
    strength = f" {row.level} D={row.detectability:.0f}" if row.truth else f" {row.level}".rstrip()
    where = f" in {row.world}" if row.stratum in ("foreign", "pair", "table") else ""
    new = f", new on the {row.bed} bed" if row.pair else ""
    return f"{truth}{strength}{where}{new}"


def _spoken(row: CaseRow) -> str:
    return f"{row.spoken} p={row.first.probability:.2f}" if row.first else row.spoken
