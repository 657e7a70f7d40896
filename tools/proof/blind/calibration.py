"""Stated probabilities, and how often they were right."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from gritd.tools.proof.blind.shares import counted
from gritd.tools.proof.blind.verdicts import CaseRow, StatedHypothesis

BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0)
SURE = 0.9  # stated probability from which a name is meant to be relied on


def calibration(rows: Sequence[CaseRow]) -> dict[str, Any]:
    """Stated probability of the first name against how often it, or the group it was stated with,
    was right.
    """
    spoken = [(row, row.first) for row in rows if row.first is not None]
    return {by: _reliable(spoken, by) for by in ("name", "engine")}


def accepted(rows: Sequence[CaseRow]) -> dict[str, Any]:
    """The same of all names that are accepted, and of those that are stated as sure."""
    spoken = [(row, name) for row in rows for name in row.accepted]
    sure = [(row, name) for row, name in spoken if name.probability >= SURE]
    return {
        by: _reliable(spoken, by)
        | {"sure": counted(row.name_right(name, by) for row, name in sure)}
        for by in ("name", "table", "engine")
    }


def _reliable(spoken: Sequence[tuple[CaseRow, StatedHypothesis]], by: str) -> dict[str, Any]:
    stated = np.array([name.probability for _, name in spoken])
    right = np.array([row.name_right(name, by) for row, name in spoken], dtype=float)
    table = [_bin(stated, right, low, high) for low, high in pairwise(BINS)]
    return {"table": table, "brier": float(np.mean((stated - right) ** 2)) if spoken else None}


def _bin(stated: Any, right: Any, low: float, high: float) -> dict[str, Any]:
    inside = (stated >= low) & ((stated < high) | ((high == 1.0) & (stated <= 1.0)))
    mean = float(stated[inside].mean()) if inside.any() else None
    share = counted(bool(value) for value in right[inside])
    return {"from": low, "to": high, "stated": mean, "right": share}
