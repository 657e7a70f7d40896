"""How an imported channel reads."""

from __future__ import annotations

from dataclasses import dataclass

from gritd.estimator.config.settings import Uncertain


@dataclass(frozen=True)
class CalibratedChannel:
    """One channel, or one axis of the wrench: physical = raw · scale + offset, SI."""

    scale: Uncertain
    offset: Uncertain
    noise: float  # standard deviation of one reading, raw
