"""Held-out errors that a diagnosis reports, compared with those of the noiseless truth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from gritd.tools.proof.blind.handover import NEW
from gritd.tools.proof.blind.trial import WorkerSpec

DAY = 86_400.0  # [s] from a reference campaign to the new one: times may count from either


def errors(
    result: Mapping[str, Any], answers: Mapping[str, Any], spec: WorkerSpec
) -> dict[str, tuple[float, float, float]]:
    """By channel, root mean square errors on the diagnosis' own held-out samples: before, after,
    and of the noiseless truth on them [the channel's unit].
    """
    sums: dict[str, list[np.ndarray[Any, Any]]] = {}
    prefix = NEW if answers["bed"] else "run"
    begins = {f"{prefix}-{n}": run["begins"] for n, run in enumerate(answers["runs"], start=1)}

    for trace in result.get("traces") or ():
        path = spec.answers.with_name(f"{spec.name}.{trace['run']}.npz")
        if path.exists():
            with np.load(path) as truth:
                if trace["channel"] in truth:
                    truth_of = begins[trace["run"]] + truth["time"], truth[trace["channel"]]
                    sums.setdefault(trace["channel"], []).append(_squares(trace, *truth_of))

    return {channel: _roots(np.concatenate(parts, axis=1)) for channel, parts in sums.items()}


def _squares(trace: Mapping[str, Any], time: Any, truth: Any) -> np.ndarray[Any, Any]:
    """Squared errors (3, n) of before, after and oracle, where the diagnosis used the sample."""
    at, measured, before, after, used = (
        np.array([math.nan if value is None else value for value in trace[name]], dtype=float)
        for name in ("time", "measured", "before", "after", "used")
    )
    if at.size:
        at = at - DAY * np.round((at[0] - time[0]) / DAY)
    squares = (measured - np.stack((before, after, np.interp(at, time, truth)))) ** 2
    kept: np.ndarray[Any, Any] = squares[:, (used > 0.5) & np.isfinite(squares).all(axis=0)]
    return kept


def _roots(squares: np.ndarray[Any, Any]) -> tuple[float, float, float]:
    if not squares.shape[1]:
        return math.nan, math.nan, math.nan
    before, after, oracle = np.sqrt(squares.mean(axis=1)).tolist()
    return before, after, oracle
