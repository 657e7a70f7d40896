"""The score as text, for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tools.proof.verdicts import Row

WIDTHS = (20, 20, 20, 20, 20, 20)


def text(score: Mapping[str, Any], rows: Sequence[Row]) -> str:
    """All tables, then what went wrong, case by case."""
    parts = [_headline(score), _strata(score), _reliability(score), _soil(score), _misses(rows)]
    return "\n\n".join(part for part in parts if part)


def said(share: Mapping[str, Any]) -> str:
    """`17/20 85 % (62–97)`; nothing where nothing was asked."""
    if not share["n"]:
        return "–"
    value = share["k"] / share["n"]
    return f"{share['k']}/{share['n']} {value:.0%} ({100 * share['low']:.0f}–{100 * share['high']:.0f})"


def number(value: float | None, form: str = ".2f") -> str:
    return "–" if value is None else format(value, form)


def _headline(score: Mapping[str, Any]) -> str:
    alarms, singles, unlisted = score["false_alarms"], score["detectable_singles"], score["unlisted"]
    heldout = score["heldout"]
    lines = [
        ("cases, of which failed", said(score["failed"])),
        ("false alarms", said(alarms["all"])),
        ("  noise as stated", said(alarms["noise as stated"])),
        ("  noise off by two", said(alarms["noise misstated"])),
        ("detectable single effects: detected", said(singles["detected"])),
        ("  first name right", said(singles["first"]["name"])),
        ("  … by the fixed groups", said(singles["first"]["table"])),
        ("  … by the group it states", said(singles["first"]["engine"])),
        ("  … by what the campaign can tell", said(singles["first"]["plant"])),
        ("  among the first three, by groups", said(singles["three"]["table"])),
        ("unlisted: recall", said(unlisted["recall"])),
        ("  given a listed name above 0.5", said(unlisted["listed name above one half"])),
        ("two effects: one named / both", f"{said(score['two']['one named'])} / {said(score['two']['both named'])}"),
        ("parameters within two sigma", said(score["parameters"]["within two sigma"])),
        ("held-out error over oracle, median", number(heldout["detectable"]["over fitted"]["median"])),
        ("  where nothing is concealed", number(heldout["none"]["over fitted"]["median"])),
        ("  where the name is right", number(heldout["named right"]["over fitted"]["median"])),
        ("  … over the noiseless truth", number(heldout["named right"]["over truth"]["median"])),
        ("Brier score, by name / stated group", " / ".join(_brier(score, by) for by in ("name", "engine"))),
        ("a diagnosis takes, median", f"{number(score['seconds']['median'], '.0f')} s"),
    ]
    return "\n".join(f"{label:36}{value}" for label, value in lines)


def _brier(score: Mapping[str, Any], by: str) -> str:
    return number(score["calibration"][by]["brier"], ".3f")


def _strata(score: Mapping[str, Any]) -> str:
    head = ("stratum", "alarm", "first name", "first, fixed groups", "first, stated group", "three, fixed groups")
    lines = [_line(head)]
    for name, of in score["strata"].items():
        first, three = of["first"], of["three"]
        cells = (of["detected"], first["name"], first["table"], first["engine"], three["table"])
        lines.append(_line((name, *(said(cell) for cell in cells))))
    return "\n".join(lines)


def _line(cells: Sequence[str]) -> str:
    return "  ".join(f"{cell:{width}}" for cell, width in zip(cells, WIDTHS, strict=True)).rstrip()


def _reliability(score: Mapping[str, Any]) -> str:
    lines = ["stated probability of the first name, and how often it (or the group it was stated with) was right"]
    by_name, by_group = (score["calibration"][by]["table"] for by in ("name", "engine"))
    for one, group in zip(by_name, by_group, strict=True):
        label = f"{one['from']:.1f} – {one['to']:.1f}"
        lines.append(f"{label:12}{number(one['stated']):8}{said(one['right']):22}{said(group['right'])}")
    return "\n".join(lines)


def _soil(score: Mapping[str, Any]) -> str:
    lines = ["relative error of c and tan φ, median before → after; within two sigma after"]
    for stratum, of in score["soil"].items():
        cells = []
        for name, found in of.items():
            before, after = (number(found[when]["median"], ".1%") for when in ("before", "after"))
            cells.append(f"{name}: {before} → {after}; {said(found['within two sigma after'])}")
        lines.append(f"{stratum:12}{'   '.join(cells)}")
    return "\n".join(lines)


def _misses(rows: Sequence[Row]) -> str:
    wrong = [row for row in rows if missed(row)]
    if not wrong:
        return ""
    return "\n".join(["what went wrong", *(f"  {row.number:4}  {explained(row)}" for row in wrong)])


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
    near = f"; the campaign cannot tell it from {', '.join(sorted(row.inseparable))}" if row.inseparable else ""
    noise = f"; stated noise × {row.noise_factor:g}" if row.noise_factor != 1.0 else ""
    note = f"; {row.note[:160]}" if row.verdict in ("failed", "insufficient") and row.note else ""
    return f"{truth}{strength} → {stated}{near}{noise}{note}"
