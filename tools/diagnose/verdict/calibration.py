"""How far evidence is to be trusted: what `python -m gritd.tools.proof.ours.calibrate` learnt from
simulated cases whose plants have other forms than the library's.

Evidence takes everything that is modelled for exact, and the larger it is the less exact it is. So
an explanation whose evidence lies d nats behind the best one has the log weight

    −s ln(1 + d/s)

which is −d where d is small, and has the tail of a t distribution where it is large (Lange, Little
and Taylor 1989, J. Am. Stat. Assoc. 84, 881-896). A probability needs besides this the odds of a
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

    scale: float  # s [nats]: differences of evidence count fully up to about this
    listed: float  # log odds of a listed effect against the discrepancy of form alone
    more: float  # log odds of one more effect
    nameless: float  # log odds of functions without a name
    lapse: float  # share of cases in which the evidence misleads: no probability exceeds 1 less it
    candidates: int = 1

    def weight(self, behind: float, count: int, nameless: bool) -> float:
        """Log weight of an explanation whose evidence lies behind the best [nats, 0 at least], by
        so many effects, with functions without a name or not.
        """
        weight = -self.scale * float(np.log1p(behind / self.scale))
        if count:
            weight += self.listed + (count - 1) * self.more - count * np.log(self.candidates)
        return float(weight + (self.nameless if nameless else 0.0))


@cache
def learnt(candidates: int = 1) -> Calibration:
    """For so many listed effects."""
    table: Mapping[str, float] = json.loads(TABLE.read_text(encoding="utf-8"))
    names = [n for n in Calibration.__dataclass_fields__ if n != "candidates"]
    return Calibration(**{name: float(table[name]) for name in names}, candidates=candidates)
