"""The score as text, for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gritd.tools.proof.blind.verdicts import Row

Table = list[tuple[str, ...]]  # rows of cells, all as long as the first
GAP = "  "


def text(score: Mapping[str, Any], rows: Sequence[Row]) -> str:
    """All tables, then what went wrong, case by case."""
    parts = [aligned(table(score)) for table in (headline, strata, reliability, soil)]
    wrong = [f"  {row.number:4}  {explained(row)}" for row in rows if missed(row)]
    return "\n\n".join([*parts, "\n".join(["what went wrong", *wrong])] if wrong else parts)


def aligned(table: Table) -> str:
    """Columns as wide as their widest cell."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = (
        GAP.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        for row in table
    )
    return "\n".join(line.rstrip() for line in lines)


def said(share: Mapping[str, Any]) -> str:
    """`17/20 85 % (62–97)`; nothing where nothing was asked."""
    if not share["n"]:
        return "–"
    value = share["k"] / share["n"]
    return (
        f"{share['k']}/{share['n']} {value:.0%} "
        f"({100 * share['low']:.0f}–{100 * share['high']:.0f})"
    )


def number(value: float | None, form: str = ".2f") -> str:
    return "–" if value is None else format(value, form)


def headline(score: Mapping[str, Any]) -> Table:
    """What a batch comes to."""
    alarms, singles, unlisted = (
        score["false_alarms"],
        score["detectable_singles"],
        score["unlisted"],
    )
    first, heldout, two = singles["first"], score["heldout"], score["two"]

    return [
        ("cases, of which failed", said(score["failed"])),
        ("false alarms", said(alarms["all"])),
        ("  noise as stated", said(alarms["noise as stated"])),
        ("  noise off by two", said(alarms["noise misstated"])),
        ("detectable single effects: detected", said(singles["detected"])),
        ("  first name right", said(first["name"])),
        ("  … by the fixed groups", said(first["table"])),
        ("  … by the group it states", said(first["engine"])),
        ("  … by what the campaign can tell", said(first["plant"])),
        ("  among the first three, by the fixed groups", said(singles["three"]["table"])),
        ("unlisted: recall", said(unlisted["recall"])),
        ("  given a listed name above 0.5", said(unlisted["listed name above one half"])),
        ("two effects: one named", said(two["one named"])),
        ("  both named", said(two["both named"])),
        ("parameters within two sigma", said(score["parameters"]["within two sigma"])),
        (
            "held-out error over oracle, median",
            number(heldout["detectable"]["over fitted"]["median"]),
        ),
        ("  where nothing is concealed", number(heldout["none"]["over fitted"]["median"])),
        ("  where the name is right", number(heldout["named right"]["over fitted"]["median"])),
        ("  … over the noiseless truth", number(heldout["named right"]["over truth"]["median"])),
        ("Brier score, by name", number(score["calibration"]["name"]["brier"], ".3f")),
        ("  by the group it states", number(score["calibration"]["engine"]["brier"], ".3f")),
        ("a diagnosis takes, median", f"{number(score['seconds']['median'], '.0f')} s"),
    ]


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
    rows = [(name, *(said(cell) for cell in _cells(of))) for name, of in score["strata"].items()]
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
            said(one["right"]),
            said(group["right"]),
        )
        for one, group in zip(by_name, by_group, strict=True)
    ]
    return [("stated probability", "mean", "name right", "stated group right"), *rows]


def soil(score: Mapping[str, Any]) -> Table:
    """Median relative error of c and tan φ before and after, and how often two sigma cover the
    truth after.
    """
    head = (
        "soil, median error",
        "c before",
        "c after",
        "within 2σ",
        "tan φ before",
        "tan φ after",
        "within 2σ",
    )

    rows = [
        (stratum, *_errors(of["c"]), *_errors(of["tan_phi"]))
        for stratum, of in score["soil"].items()
    ]

    return [head, *rows]


def _errors(of: Mapping[str, Any]) -> tuple[str, str, str]:
    before, after = (number(of[when]["median"], ".1%") for when in ("before", "after"))
    return before, after, said(of["within two sigma after"])


def missed(row: Row) -> bool:
    """Not what should have been said: an alarm without cause, or a cause without its name."""
    if not row.truth:
        return row.alarmed or row.verdict == "failed"
    if row.stratum == "unlisted":
        return row.verdict != "unlisted"
    return not (row.first_right("table") or row.first_right("engine"))


def explained(row: Row) -> str:
    """One line: truth and strength, what was said, and why it may be."""
    truth = " + ".join(row.truth) or "none"
    strength = f" {row.level} D={row.detectability:.0f}" if row.truth else ""
    stated = f"{row.spoken} p={row.first.probability:.2f}" if row.first else row.spoken
    near = (
        f"; the campaign cannot tell it from {', '.join(sorted(row.inseparable))}"
        if row.inseparable
        else ""
    )
    noise = f"; stated noise × {row.noise_factor:g}" if row.noise_factor != 1.0 else ""
    note = f"; {row.note[:160]}" if row.verdict in ("failed", "insufficient") and row.note else ""
    return f"{truth}{strength} → {stated}{near}{noise}{note}"
