"""A field of tuned numbers, with its unit, its reason and what it was learnt from."""

from __future__ import annotations

from dataclasses import field
from typing import TypeVar

T = TypeVar("T")

JUDGEMENT = "judgement"


def tuned(value: T, unit: str, reason: str, learnt: str = JUDGEMENT) -> T:
    """A dataclass field. Its metadata holds unit, reason and learnt.

    unit: "share" and "probability" are halved and doubled in their odds, "quantile" in the odds of
    its tail; "prior" and "choice" are not halved.
    """
    about = {"unit": unit, "reason": reason, "learnt": learnt}
    return field(default_factory=lambda: value, metadata=about)
