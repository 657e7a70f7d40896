"""How far evidence is to be trusted: what `python -m gritd.tools.proof.ours.calibrate` learnt from
simulated cases whose plants have other forms than the library's.

The evidence of every explanation [nats] becomes a probability by one temperature, the odds of a
listed effect, of one more effect and of what is in no list, and the share of cases in which all
evidence misleads.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

TABLE = Path(__file__).with_name("calibration.json")


@dataclass(frozen=True)
class Calibration:
    """candidates: listed effects, which share the odds among them."""

    temperature: float  # by which evidence is divided
    listed: float  # log odds of a listed effect against the discrepancy of form alone
    more: float  # log odds of one more effect
    nameless: float  # log odds of functions without a name
    lapse: float  # share of cases in which the evidence misleads: no probability exceeds 1 less it
    candidates: int = 1

    def weight(self, evidence: float, count: int, nameless: bool) -> float:
        """Log weight of an explanation by so many effects, with functions without a name or not."""
        weight = evidence / self.temperature
        if count:
            weight += self.listed + (count - 1) * self.more - count * np.log(self.candidates)
        return float(weight + (self.nameless if nameless else 0.0))


@cache
def learnt(candidates: int = 1) -> Calibration:
    """For so many listed effects."""
    table: Mapping[str, float] = json.loads(TABLE.read_text(encoding="utf-8"))
    names = [n for n in Calibration.__dataclass_fields__ if n != "candidates"]
    return Calibration(**{name: float(table[name]) for name in names}, candidates=candidates)
