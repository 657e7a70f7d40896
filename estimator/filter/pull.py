"""The largest drawbar pull the soil now offers at this load and sinkage: what a driver wants to
know.

It takes DP at several slips. The search does one of them a tick, so that no tick bears them all,
and starts from the latest update when it is not under way; its result is some ticks old.
"""

from __future__ import annotations

from math import nan
from typing import NamedTuple

from gritd.estimator.filter.estimate import Estimate
from gritd.estimator.filter.measurement import ByParameters, Measurement
from gritd.estimator.filter.model import ForcePrediction
from gritd.estimator.wheel.wheel_state import WheelState

SLIPS = (0.2, 0.4, 0.6, 0.8, 1.0)


class Pull(NamedTuple):
    """The largest drawbar pull."""

    value: float = nan  # [N]
    sigma: float = nan  # [N]
    slip: float = nan  # at which it is reached [-]


UNKNOWN = Pull()


class Search(NamedTuple):
    """A search under way: the soil and the window it is made for, and DP [N] at the first of
    SLIPS.
    """

    estimate: Estimate
    now: WheelState
    by_parameters: ByParameters
    pulls: tuple[float, ...] = ()


def search_on(measurement: Measurement, search: Search, known: Pull) -> tuple[Search | None, Pull]:
    """One step of the search, and the result so far; no search after the last step."""
    if len(search.pulls) < len(SLIPS):
        _, prediction = _at(measurement, search, SLIPS[len(search.pulls)])
        return search._replace(pulls=(*search.pulls, prediction.drawbar_pull.value)), known
    best = best_slip(search.pulls)
    there, prediction = _at(measurement, search, best)
    shared = measurement.shared(there, prediction, search.by_parameters)
    _, sigma, _ = measurement.sigmas(search.estimate, there, prediction, shared)
    return None, Pull(prediction.drawbar_pull.value, sigma, best)


def _at(
    measurement: Measurement, search: Search, slip: float
) -> tuple[WheelState, ForcePrediction]:
    """The window at another slip, and what is predicted there."""
    there = measurement.at_slip(search.now, slip)
    return there, measurement.predict(search.estimate, there)


def best_slip(pulls: tuple[float, ...]) -> float:
    """Slip of the largest drawbar pull, from its values at SLIPS: the best of them, refined by a
    parabola.
    """
    best = max(range(len(SLIPS)), key=pulls.__getitem__)
    if best in (0, len(SLIPS) - 1):
        return SLIPS[best]
    before, peak, after = pulls[best - 1 : best + 2]
    return SLIPS[best] + 0.5 * (SLIPS[1] - SLIPS[0]) * (before - after) / (
        before - 2.0 * peak + after
    )
