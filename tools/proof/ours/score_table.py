"""The table of the trials: names, false alarms, soil, held-out error, calibration."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import beta

Results = Sequence[dict[str, Any]]


def table(results: Results) -> str:
    """Markdown, a line a figure, with 95 % bounds after Clopper and Pearson (1934)."""
    done = [r for r in results if "verdict" in r]
    none, one = ([r for r in done if r["stratum"] == s] for s in ("none", "effect"))
    cousin, pair, unlisted = (
        [r for r in done if r["stratum"] == s] for s in ("cousin", "pair", "unlisted")
    )

    lines = ["| figure | value |", "|---|---|"]
    lines += [f"| {name} | {value} |" for name, value in _rows(none, one, cousin, pair, unlisted)]

    failed = [r for r in results if "error" in r]
    unseen = sum("skipped" in r for r in results)
    unusable = f"{unseen} undetectable in any campaign drawn, {len(failed)} errors"
    lines.append(f"| cases | {len(done)}, {unusable} |")
    lines += (
        [f"| seconds a case, median | {np.median([r['seconds'] for r in done]):.0f} |"]
        if done
        else []
    )

    return "\n".join(
        [
            *lines,
            "",
            *_reliability(one + none + cousin + unlisted),
            "",
            *_misses(one + cousin + unlisted),
        ]
    )


def _rows(
    none: Results, one: Results, cousin: Results, pair: Results, unlisted: Results
) -> list[tuple[str, str]]:
    alarmed = [r for r in one if r["verdict"] in ("explained", "unlisted")]
    absorbed = [r for r in one if _error(r, 1) > 2.0]

    return [
        ("detected at 3-5 times the limit", _rate(len(alarmed), len(one))),
        ("right name first, or in its group", _rate(sum(_first(r) for r in one), len(one))),
        (
            "a wrong name",
            _rate(sum(r["verdict"] == "explained" and not _first(r) for r in one), len(one)),
        ),
        ("among the first three", _rate(sum(_three(r) for r in one), len(one))),
        (
            "false alarms without effect",
            _rate(sum(r["verdict"] in ("explained", "unlisted") for r in none), len(none)),
        ),
        (
            "right name of another published form",
            _rate(sum(_first(r) for r in cousin), len(cousin)),
        ),
        ("both of a pair accepted, by group", _rate(sum(_both(r) for r in pair), len(pair))),
        (
            "unlisted effects called unlisted",
            _rate(sum(r["verdict"] == "unlisted" for r in unlisted), len(unlisted)),
        ),
        (
            "unlisted effects given a name above 0.5",
            _rate(sum(_named(r) for r in unlisted), len(unlisted)),
        ),
        ("c or tan φ off by more than 2σ before", _rate(len(absorbed), len(one))),
        (
            "of those within 2σ after",
            _rate(sum(_error(r, 3) <= 2.0 for r in absorbed), len(absorbed)),
        ),
        (
            "held-out error over oracle, median",
            _median([r["oracle"] for r in one if "oracle" in r]),
        ),
        (
            "held-out error within 10 % of oracle",
            _rate(sum(r.get("oracle", 9) <= 1.1 for r in one), len(one)),
        ),
        (
            "Brier score of the first name",
            f"{np.mean([_brier(r) for r in one]):.3f}" if one else "-",
        ),
    ]


def _rate(hits: int, of: int) -> str:
    if not of:
        return "-"
    low = beta.ppf(0.025, hits, of - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, of - hits) if hits < of else 1.0
    return f"{hits}/{of} = {hits / of:.0%} ({low:.0%} … {high:.0%})"


def _median(values: list[float]) -> str:
    return f"{np.median(values):.3f}" if values else "-"


def _group(result: dict[str, Any], name: str) -> set[str]:
    return {name, *result["groups"].get(name, [])}


def _first(result: dict[str, Any]) -> bool:
    return (
        bool(result["first"])
        and result["verdict"] == "explained"
        and result["truth"][0] in _group(result, result["first"])
    )


def _three(result: dict[str, Any]) -> bool:
    return _first(result) or result["truth"][0] in result["ranking"][:3]


def _both(result: dict[str, Any]) -> bool:
    named = [_group(result, n) for n in result["accepted"]]
    return len(named) == len(result["truth"]) and all(
        any(t in g for g in named) for t in result["truth"]
    )


def _named(result: dict[str, Any]) -> bool:
    return max(result["probability"].values(), default=0.0) > 0.5


def _error(result: dict[str, Any], at: int) -> float:
    """Largest error of c and tan φ in stated σ; `at` 1 before, 3 after."""
    return float(max(abs(v[at] - v[0]) / max(v[at + 1], 1e-12) for v in result["soil"].values()))


def _brier(result: dict[str, Any]) -> float:
    """Of the group of the first name."""
    group = _group(result, result["first"]) if result["first"] else set()
    stated = min(sum(result["probability"].get(n, 0.0) for n in group), 1.0)
    return float((stated - float(result["truth"][0] in group)) ** 2)


def _reliability(results: Results) -> list[str]:
    """Stated probability of the first group against how often it was right."""
    stated, right = [], []
    for r in results:
        if r["first"]:
            group = _group(r, r["first"])
            stated.append(min(sum(r["probability"].get(n, 0.0) for n in group), 1.0))
            right.append(bool(r["truth"]) and r["truth"][0] in group)

    lines = ["| stated | cases | right |", "|---|---|---|"]
    edges = (0.0, 0.2, 0.5, 0.8, 0.95, 1.0001)
    for low, high in pairwise(edges):
        own = [ok for s, ok in zip(stated, right, strict=True) if low <= s < high]
        lines.append(
            f"| {low:.2f}-{min(high, 1.0):.2f} | {len(own)} | {np.mean(own):.0%} |"
            if own
            else f"| {low:.2f}-{min(high, 1.0):.2f} | 0 | - |"
        )
    return lines


def _misses(results: Results) -> list[str]:
    return [
        f"- {r['truth'][0]}: {r['verdict']}, said {r['accepted'] or r['ranking'][:3]}"
        for r in results
        if not _first(r)
    ]
