"""How far evidence is to be trusted: what `python -m gritd.tools.proof.ours.calibrate` learnt from
simulated cases.

The evidence of every explanation [nats] becomes a probability by one temperature, one weight for
each degree to which a published form may differ from ours, the odds of one more effect and of
physics that is in no list, and the share of cases in which all evidence misleads.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.special import logsumexp

from gritd.estimator.terramechanics.soil import Array

TABLE = Path(__file__).with_name("calibration.json")


@dataclass(frozen=True)
class Calibration:
    temperature: float  # by which evidence is divided
    forms: tuple[float, ...]  # log weight of each degree of difference of discrepancy.py
    more: float  # log odds of one more effect
    nameless: float  # log odds of functions without a name in the place of an effect
    lapse: (
        float  # share of cases in which the evidence misleads: no probability exceeds 1 less this
    )

    def listed(self, evidence: Array, count: int) -> float:
        """Log weight of `count` effects, from their evidence (FORMS,) above the base model's."""
        return float(
            logsumexp(evidence / self.temperature + np.array(self.forms))
            + self.more * max(count - 1, 0)
        )

    def unlisted(self, evidence: float) -> float:
        """Log weight of functions without a name, from their evidence above the base model's."""
        return evidence / self.temperature + self.nameless


@cache
def learnt() -> Calibration:
    table: Mapping[str, object] = json.loads(TABLE.read_text(encoding="utf-8"))
    values = {name: table[name] for name in Calibration.__dataclass_fields__}
    return Calibration(**{n: tuple(v) if isinstance(v, list) else v for n, v in values.items()})  # type: ignore[arg-type]
