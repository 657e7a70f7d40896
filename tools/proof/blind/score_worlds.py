"""Counting in foreign worlds, in pairs of campaigns, and of the soil that is found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from gritd.tools.proof.blind.calibration import accepted
from gritd.tools.proof.blind.plant.concealed import LISTED
from gritd.tools.proof.blind.plant.worlds import WORLDS
from gritd.tools.proof.blind.shares import counted, quantiles
from gritd.tools.proof.blind.strata import BEDS
from gritd.tools.proof.blind.verdicts import CaseRow

SOIL = ("c", "tan_phi")


def soil(rows: Sequence[CaseRow]) -> dict[str, Any]:
    """Errors of c and tan φ, before the diagnosis and after it, and how often σ covers them."""
    answered = [row for row in rows if row.verdict != "failed"]
    return {name: _quantity(name, answered) for name in SOIL}


def _quantity(name: str, rows: Sequence[CaseRow]) -> dict[str, Any]:
    stated = [row.soil[name] for row in rows if name in row.soil]
    counts: dict[str, Any] = {}
    for when in ("before", "after"):
        z = [one[f"z_{when}"] for one in stated]
        known = [value for value in z if math.isfinite(value)]
        counts[when] = quantiles([one[when] for one in stated])
        counts[f"within one sigma {when}"] = counted(abs(value) < 1.0 for value in known)
        counts[f"within two sigma {when}"] = counted(abs(value) < 2.0 for value in known)
        counts[f"unknown {when}"] = counted(not math.isfinite(value) for value in z)
    return counts


def foreign(rows: Sequence[CaseRow]) -> dict[str, Any]:
    """Campaigns alone in worlds of which the diagnosis knows nothing, by world. A name is right
    where it says what is concealed, or a part of what the world has of its own.
    """
    groups = {"all": list(rows)} | {w: [r for r in rows if r.world == w] for w in WORLDS}
    return {name: _foreign(of) for name, of in groups.items() if of}


def _foreign(rows: Sequence[CaseRow]) -> dict[str, Any]:
    spoken = [row for row in rows if row.first is not None]
    verdicts = ("consistent", "explained", "unlisted", "insufficient", "failed")

    return {
        "verdicts": {
            verdict: counted(row.verdict == verdict for row in rows) for verdict in verdicts
        },
        "first name true": counted(row.first_right("table") for row in spoken),
        "false companion": counted(row.false_companion() for row in spoken),
        "concealed first": counted(_concealed_first(row) for row in rows if row.truth),
        "soil": soil(rows),
    }


def _concealed_first(row: CaseRow) -> bool:
    return row.first is not None and bool(row.first.group & set(row.truth))


def pairs(rows: Sequence[CaseRow]) -> dict[str, Any]:
    """A reference campaign and a new one: what is said to be new, by world and by bed."""
    groups = {"all": list(rows)} | {w: [r for r in rows if r.world == w] for w in WORLDS}
    groups |= {f"{bed} bed": [row for row in rows if row.bed == bed] for bed in BEDS}
    groups["reference unlisted"] = [row for row in rows if row.reference_verdict == "unlisted"]
    return {name: _pairs(of) for name, of in groups.items() if of}


def _pairs(rows: Sequence[CaseRow]) -> dict[str, Any]:
    nothing = [row for row in rows if not row.truth and row.verdict != "failed"]
    listed = [row for row in rows if row.detectable and row.truth[0] in LISTED]
    strange = [row for row in rows if row.detectable and row.truth[0] not in LISTED]

    return {
        "failed": counted(row.verdict == "failed" for row in rows),
        "false alarms": counted(row.alarmed for row in nothing),
        "detected": counted(row.alarmed for row in listed),
        "first": {
            by: counted(row.first_right(by) for row in listed) for by in ("name", "table", "engine")
        },
        "false companion": counted(row.false_companion() for row in listed),
        "accepted": accepted(rows),
        "unlisted": counted(row.verdict == "unlisted" for row in strange),
        "over truth": quantiles([row.excess("truth") for row in rows]),
        "over fitted": quantiles([row.excess("fitted") for row in rows]),
        "soil": soil(rows),
    }
