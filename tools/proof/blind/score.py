"""Counting: detection, names, probabilities, soil, parameters and held-out errors, by stratum, with
intervals.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from gritd.tools.proof.blind import score_worlds
from gritd.tools.proof.blind.calibration import accepted, calibration
from gritd.tools.proof.blind.shares import counted, quantiles
from gritd.tools.proof.blind.strata import AWKWARD, LEVELS, STRATA
from gritd.tools.proof.blind.verdicts import CaseRow

BY = ("name", "table", "engine", "plant")  # how a name counts as right
AT_HOME = tuple(name for name in STRATA if name not in ("foreign", "pair", "table"))
ONE = ("single", "usual", "absorbed", "confounded")  # strata with one listed effect


def score(rows: Sequence[CaseRow]) -> dict[str, Any]:
    """Everything, as JSON types. What is not said to be of foreign worlds or pairs is of campaigns
    alone in the paper's world.
    """
    home = [row for row in rows if row.stratum in AT_HOME]
    effects = [row for row in home if row.truth]
    singles = [row for row in effects if row.stratum in ("single", "absorbed")]
    detectable = [row for row in singles if row.detectable]

    return {
        "cases": len(rows),
        "failed": counted(row.verdict == "failed" for row in rows),
        "false_alarms": _false_alarms([row for row in home if not row.truth]),
        "detectable_singles": _names(detectable),
        "usual_singles": _names([r for r in home if r.stratum == "usual" and r.detectable]),
        "companions": _companions([row for row in effects if row.stratum != "unlisted"]),
        "strata": _strata(rows),
        "effects": {
            name: _names([r for r in singles if r.truth == (name,)])
            for name in sorted(_true_names(singles))
        },
        "two": _two([row for row in home if row.stratum == "two"]),
        "unlisted": unlisted([row for row in home if row.stratum == "unlisted"]),
        "calibration": calibration(home),
        "accepted": accepted(home),
        "soil": {name: score_worlds.soil(of) for name, of in _soil_groups(rows).items()},
        "parameters": _coverage(row.parameters for row in effects),
        "heldout": {name: heldout(of) for name, of in _heldout_groups(home, detectable).items()},
        "foreign": score_worlds.foreign([row for row in rows if row.stratum == "foreign"]),
        "pairs": score_worlds.pairs([row for row in rows if row.stratum == "pair"]),
        "tables": score_worlds.pairs([row for row in rows if row.stratum == "table"]),
        "confusion": confusion(rows),
        "seconds": quantiles([row.seconds for row in rows]),
        "seconds of pairs": quantiles([row.seconds for row in rows if row.stratum == "pair"]),
    }


def _true_names(rows: Iterable[CaseRow]) -> set[str]:
    return {name for row in rows for name in row.truth}


def _false_alarms(given: Sequence[CaseRow]) -> dict[str, Any]:
    nulls = [row for row in given if row.verdict != "failed"]
    usual = [row for row in nulls if row.stratum == "none"]
    ways = {one.level: [row for row in nulls if row.level == one.level] for one in AWKWARD}
    return {
        "all": counted(row.alarmed for row in nulls),
        "noise as stated": counted(row.alarmed for row in usual if row.noise_factor == 1.0),
        "noise misstated": counted(row.alarmed for row in usual if row.noise_factor != 1.0),
        "awkward": {way: counted(row.alarmed for row in of) for way, of in ways.items()},
        "insufficient": counted(row.verdict == "insufficient" for row in nulls),
    }


def _names(rows: Sequence[CaseRow]) -> dict[str, Any]:
    """Alarms of all, and names where something of the list is there."""
    there = [row for row in rows if row.nameable]
    return {
        "detected": counted(row.alarmed for row in rows),
        "first": {by: counted(row.first_right(by) for row in there) for by in BY},
        "three": {by: counted(row.three_right(by) for row in there) for by in BY},
        "given": {by: quantiles([row.given(by) for row in there]) for by in BY},
    }


def _companions(rows: Sequence[CaseRow]) -> dict[str, Any]:
    """Campaigns with one or two listed effects: a further name accepted that is not there."""
    return {by: counted(row.false_companion(by) for row in rows) for by in ("table", "engine")}


def _strata(rows: Sequence[CaseRow]) -> dict[str, Any]:
    """By stratum, and by level within those that have several."""
    counts = {}
    for stratum in STRATA:
        inside = [row for row in rows if row.stratum == stratum]
        levels = sorted({row.level for row in inside}, key=_order)
        for level in ("", *(levels if len(levels) > 1 else ())):
            chosen = [row for row in inside if level in ("", row.level)]
            counts[f"{stratum} {level}".strip()] = _names(chosen)
    return {name: of for name, of in counts.items() if of["detected"]["n"]}


def _order(level: str) -> tuple[int, str]:
    """Levels of strength from weak to strong, others by name."""
    return (list(LEVELS).index(level) if level in LEVELS else -1, level)


def _two(rows: Sequence[CaseRow]) -> dict[str, Any]:
    """Whatever else is concealed; and where each effect alone is named, or alarms, in the same
    campaign.
    """
    named = [row for row in rows if row.alone and all(o.first_right("table") for o in row.alone)]
    alarmed = [row for row in rows if row.alone and all(one.alarmed for one in row.alone)]
    return {
        "one named": counted(
            any(row.name_right(name, "table") for name in row.accepted) for row in rows
        ),
        "both named": counted(row.both_named() for row in rows),
        "both named by group": counted(row.both_named("table") for row in rows),
        "both named where each alone is": counted(row.both_named("table") for row in named),
        "both named where each alone alarms": counted(row.both_named("table") for row in alarmed),
        "a wrong one accepted": counted(
            any(not row.name_right(name, "table") for name in row.accepted) for row in rows
        ),
    }


def unlisted(rows: Sequence[CaseRow]) -> dict[str, Any]:
    """Of campaigns with physics outside the list that one who knows all else would see."""
    seen = [row for row in rows if row.detectable]

    return {
        "recall": counted(row.verdict == "unlisted" for row in seen),
        "recall of those alarmed": counted(
            row.verdict == "unlisted" for row in seen if row.alarmed
        ),
        "listed name above one half": counted(
            row.first is not None and row.first.probability > 0.5 for row in seen
        ),
    }


def _soil_groups(rows: Sequence[CaseRow]) -> dict[str, list[CaseRow]]:
    """By what is concealed; of foreign worlds and pairs all together."""
    groups = {"none": ("none",), "awkward": ("awkward",), "one effect": ONE}
    groups |= {name: (name,) for name in ("absorbed", "two", "unlisted", "foreign", "pair")}
    return {name: [row for row in rows if row.stratum in of] for name, of in groups.items()}


def _coverage(parameters: Iterable[Mapping[str, float]]) -> dict[str, Any]:
    z = [value for z_of in parameters for value in z_of.values() if math.isfinite(value)]
    return {
        "within one sigma": counted(abs(v) < 1.0 for v in z),
        "within two sigma": counted(abs(v) < 2.0 for v in z),
    }


def _heldout_groups(
    rows: Sequence[CaseRow], detectable: Sequence[CaseRow]
) -> dict[str, list[CaseRow]]:
    right = [row for row in detectable if row.first_right("table")]
    return {
        "none": [row for row in rows if not row.truth],
        "detectable": list(detectable),
        "named right": right,
    }


def heldout(rows: Sequence[CaseRow]) -> dict[str, Any]:
    """Held-out errors over the oracle's."""
    return {
        f"over {oracle}": quantiles([row.excess(oracle) for row in rows])
        for oracle in ("fitted", "truth")
    }


def confusion(rows: Sequence[CaseRow]) -> dict[str, dict[str, int]]:
    """truth → what was said first → how often; two effects count under both names joined."""
    counts: dict[str, Counter[str]] = {}
    for row in rows:
        counts.setdefault(_heading(row), Counter())[_heard(row)] += 1
    return {truth: dict(of) for truth, of in sorted(counts.items())}


def _heading(row: CaseRow) -> str:
    if len(row.truth) > 1:
        return "(two effects)"
    truth = " + ".join(row.truth) or "(none)"
    if row.stratum in ("unlisted", "foreign", "pair"):
        truth = f"{row.stratum}: {truth}"
    return truth


def _heard(row: CaseRow) -> str:
    if len(row.truth) > 1 and row.first is not None:
        return "(one of them)" if row.first_right("table") else "(another)"
    return row.spoken
