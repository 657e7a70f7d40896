"""A campaign's figures as numbers: forces against slip, estimates run by run."""

from __future__ import annotations

from math import isfinite, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gritd.estimator.filter.estimate import KPA, TAN_PHI, C, Estimate
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.report.campaign import FORCES, ReportedCampaign, mean_over
from gritd.tools.report.lab import LabRun, MeasuredWindows

MOST = 400  # windows of a load


def numbers(campaign: ReportedCampaign) -> dict[str, Any]:
    """SI units; what is not known is None."""
    return {
        "testbed": campaign.testbed,
        "runs": [_run(run) for run in campaign.runs],
        "soil": _soil(campaign.estimate),
        "notes": list(campaign.notes),
    }


def _run(run: LabRun) -> dict[str, Any]:
    of, reason = run.run, run.run.reason
    return {
        "name": run.name,
        "file": str(of.recording.path),
        "counts": of.counts,
        "reason": str(reason),
        "alone": _soil(of.alone.estimate),
        "together": _soil(of.known.estimate),
        "loads": [_load(part) for part in run.windows.by_load()] if run.windows else [],
    }


def _soil(estimate: Estimate) -> dict[str, dict[str, float]]:
    x, P = estimate.x, estimate.soil_P
    return {
        "cohesion": {"value": x[C] * KPA, "sigma": sqrt(P[C][C]) * KPA},
        "tan_phi": {"value": x[TAN_PHI], "sigma": sqrt(P[TAN_PHI][TAN_PHI])},
    }


def _load(part: MeasuredWindows) -> dict[str, Any]:
    """The windows of a load in the order of slip, and both forms' means over it."""
    order = np.argsort(part.slip)
    some = order[:: max(1, -(-len(order) // MOST))]
    return {
        "load": float(np.mean(part.load)),
        "slip": _list(part.slip[some]),
        **{name: _force(part, name, some) for name in FORCES},
    }


def _force(part: MeasuredWindows, name: str, some: NDArray[np.intp]) -> dict[str, Any]:
    off = {which: part.off(name, which) for which in ("original", "closed")}
    forms = {
        which: dict(zip(("slip", "value"), map(_list, mean_over(part.slip, values)), strict=True))
        for which, values in (("original", part.original[name]), ("closed", part.closed[name]))
    }
    return {
        "measured": _list(part.measured[name][some]),
        **forms,
        "off": {which: value if isfinite(value) else None for which, value in off.items()},
    }


def _list(values: Array) -> list[float | None]:
    return [float(v) if isfinite(v) else None for v in values.tolist()]
