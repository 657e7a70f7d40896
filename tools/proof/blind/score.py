"""Counting: detection, names, probabilities, soil, parameters and held-out errors, by stratum, with
intervals.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import beta

from gritd.tools.proof.blind.strata import LEVELS, STRATA
from gritd.tools.proof.blind.verdicts import Row

BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0)
DETECTABLE = 0.9 * LEVELS["weak"]  # times the detection limit
BY = ("name", "table", "engine", "plant")  # how a name counts as right


@dataclass(frozen=True)
class Share:
    """k of n, with the 95 % interval of Clopper and Pearson (1934)."""

    k: int
    n: int
    low: float
    high: float

    @property
    def value(self) -> float:
        return self.k / self.n if self.n else math.nan


def share(outcomes: Iterable[bool]) -> Share:
    given = list(outcomes)
    k, n = sum(given), len(given)
    low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
    high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
    return Share(k, n, low, high)


def score(rows: Sequence[Row]) -> dict[str, Any]:
    """Everything, as JSON types."""
    effects = [row for row in rows if row.truth]
    singles = [row for row in effects if row.stratum in ("single", "absorbed")]
    detectable = [row for row in singles if row.detectability >= DETECTABLE * row.limit]

    return {
        "cases": len(rows),
        "failed": _share(row.verdict == "failed" for row in rows),
        "false_alarms": _false_alarms(
            [row for row in rows if not row.truth and row.verdict != "failed"]
        ),
        "detectable_singles": _names(detectable),
        "strata": _strata(rows),
        "effects": {
            name: _names([r for r in singles if r.truth == (name,)])
            for name in sorted(_true_names(singles))
        },
        "two": _two([row for row in rows if row.stratum == "two"]),
        "unlisted": _unlisted([row for row in rows if row.stratum == "unlisted"]),
        "calibration": calibration(rows),
        "soil": {name: _soil(of) for name, of in _soil_groups(rows).items()},
        "parameters": _coverage(row.parameters for row in effects),
        "heldout": {name: _heldout(of) for name, of in _heldout_groups(rows, detectable).items()},
        "confusion": confusion(rows),
        "seconds": _quantiles([row.seconds for row in rows]),
    }


def _share(outcomes: Iterable[bool]) -> dict[str, Any]:
    return asdict(share(outcomes))


def _true_names(rows: Iterable[Row]) -> set[str]:
    return {name for row in rows for name in row.truth}


def _false_alarms(nulls: Sequence[Row]) -> dict[str, Any]:
    return {
        "all": _share(row.alarmed for row in nulls),
        "noise as stated": _share(row.alarmed for row in nulls if row.noise_factor == 1.0),
        "noise misstated": _share(row.alarmed for row in nulls if row.noise_factor != 1.0),
        "insufficient": _share(row.verdict == "insufficient" for row in nulls),
    }


def _names(rows: Sequence[Row]) -> dict[str, Any]:
    return {
        "detected": _share(row.alarmed for row in rows),
        "first": {by: _share(row.first_right(by) for row in rows) for by in BY},
        "three": {by: _share(row.three_right(by) for row in rows) for by in BY},
        "given": {by: _quantiles([row.given(by) for row in rows]) for by in BY},
    }


def _strata(rows: Sequence[Row]) -> dict[str, Any]:
    """By stratum, and by level within those that have several."""
    found = {}
    for stratum in STRATA:
        inside = [row for row in rows if row.stratum == stratum]
        for level in ("", *LEVELS):
            chosen = [row for row in inside if level in ("", row.level)]
            if chosen and (not level or len({row.level for row in inside}) > 1):
                found[f"{stratum} {level}".strip()] = _names(chosen)
    return found


def _two(rows: Sequence[Row]) -> dict[str, Any]:
    def accepted(row: Row) -> list[str]:
        return (
            [said.effect for said in row.hypotheses if said.accepted]
            if row.verdict == "explained"
            else []
        )

    return {
        "one named": _share(
            any(row.right(name, "table") for name in accepted(row)) for row in rows
        ),
        "both named": _share(set(row.truth) <= set(accepted(row)) for row in rows),
        "a wrong one accepted": _share(
            any(not row.right(name, "table") for name in accepted(row)) for row in rows
        ),
    }


def _unlisted(rows: Sequence[Row]) -> dict[str, Any]:
    detectable = [row for row in rows if row.detectability >= DETECTABLE * row.limit]
    return {
        "recall": _share(row.verdict == "unlisted" for row in detectable),
        "recall of those alarmed": _share(
            row.verdict == "unlisted" for row in detectable if row.alarmed
        ),
        "listed name above one half": _share(
            row.first is not None and row.first.probability > 0.5 for row in detectable
        ),
    }


def calibration(rows: Sequence[Row]) -> dict[str, Any]:
    """Stated probability of the first name against how often it, or the group it was stated with,
    was right.
    """
    spoken = [(row, row.first) for row in rows if row.first is not None]
    stated = np.array([said.probability for _, said in spoken])
    found: dict[str, Any] = {}
    for by in ("name", "engine"):
        right = np.array([row.first_right(by) for row, _ in spoken], dtype=float)
        table = [_bin(stated, right, low, high) for low, high in pairwise(BINS)]
        brier = float(np.mean((stated - right) ** 2)) if spoken else None
        found[by] = {"table": table, "brier": brier}
    return found


def _bin(stated: Any, right: Any, low: float, high: float) -> dict[str, Any]:
    inside = (stated >= low) & ((stated < high) | ((high == 1.0) & (stated <= 1.0)))
    mean = float(stated[inside].mean()) if inside.any() else None
    return {
        "from": low,
        "to": high,
        "stated": mean,
        "right": _share(bool(value) for value in right[inside]),
    }


def _soil_groups(rows: Sequence[Row]) -> dict[str, list[Row]]:
    return {
        name: [row for row in rows if row.stratum == name]
        for name in ("none", "single", "absorbed")
    }


def _soil(rows: Sequence[Row]) -> dict[str, Any]:
    found = {}

    for name in ("c", "tan_phi"):
        before, after = (
            [row.soil[name][when] for row in rows if name in row.soil]
            for when in ("before", "after")
        )
        inside = [row.soil[name]["z_after"] for row in rows if name in row.soil]
        found[name] = {
            "before": _quantiles(before),
            "after": _quantiles(after),
            "within two sigma after": _share(abs(z) < 2.0 for z in inside if math.isfinite(z)),
        }

    return found


def _coverage(parameters: Iterable[Mapping[str, float]]) -> dict[str, Any]:
    z = [value for found in parameters for value in found.values() if math.isfinite(value)]
    return {
        "within one sigma": _share(abs(v) < 1.0 for v in z),
        "within two sigma": _share(abs(v) < 2.0 for v in z),
    }


def _heldout_groups(rows: Sequence[Row], detectable: Sequence[Row]) -> dict[str, list[Row]]:
    right = [row for row in detectable if row.first_right("table")]
    return {
        "none": [row for row in rows if not row.truth],
        "detectable": list(detectable),
        "named right": right,
    }


def _heldout(rows: Sequence[Row]) -> dict[str, Any]:
    return {
        f"over {oracle}": _quantiles([row.excess(oracle) for row in rows])
        for oracle in ("fitted", "truth")
    }


def confusion(rows: Sequence[Row]) -> dict[str, dict[str, int]]:
    """truth → what was said first → how often; two effects count under both names joined."""
    counts: dict[str, Counter[str]] = {}
    for row in rows:
        truth = " + ".join(row.truth) or "(none)"
        truth = f"unlisted: {truth}" if row.stratum == "unlisted" else truth
        truth = "(two effects)" if len(row.truth) > 1 else truth
        counts.setdefault(truth, Counter())[_heard(row)] += 1
    return {truth: dict(counted) for truth, counted in sorted(counts.items())}


def _heard(row: Row) -> str:
    if len(row.truth) > 1 and row.first is not None:
        return "(one of them)" if row.first_right("table") else "(another)"
    return row.spoken


def _quantiles(values: Sequence[float]) -> dict[str, Any]:
    finite = [value for value in values if math.isfinite(value)]
    if not finite:
        return {"n": 0, "quarter": None, "median": None, "three quarters": None}
    quarter, median, most = np.quantile(finite, (0.25, 0.5, 0.75)).tolist()
    return {"n": len(finite), "quarter": quarter, "median": median, "three quarters": most}
