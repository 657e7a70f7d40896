"""How far evidence is to be trusted: what `python -m gritd.tools.proof.ours.calibrate` learnt from
simulated cases whose plants have other forms than the library's.

The evidence of every explanation [nats] becomes a probability by one temperature, the odds of a
listed effect, of one more effect and of what is in no list, and the share of cases in which all
evidence misleads. They are the same beside a reference, as what the rig does anyway acts in both
campaigns.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.tuning import TUNING

TABLE = Path(__file__).with_name("calibration.json")


@dataclass(frozen=True)
class OddsCalibration:
    """Log odds are against the discrepancy of form alone. candidates: listed effects, each of which
    has an equal share of the odds.
    """

    temperature: float  # by which evidence is divided
    listed: float  # log odds of a listed effect against the discrepancy of form alone
    more: float  # log odds of one more effect
    nameless: float  # log odds of unexplained terms
    lapse: float  # share of cases in which the evidence misleads: no probability exceeds 1 less it
    candidates: int = 1

    def weights(
        self, evidence: Array, count: Array, functions: Array, companions: Array | None = None
    ) -> Array:
        """Log weights (k,) of explanations, up to a constant; the lapse is not in them.

        evidence: above the discrepancy of form alone [nats] (k,); count: of listed effects (k,);
        functions: without a name that act too (k,). Of a large misfit no formula takes all, and
        what one leaves pays for companions (k,) that are not there: each must gain a share of it,
        where that is more than the odds of one more ask for. None: all that act beside another.
        """
        if companions is None:
            companions = np.maximum(count + functions - 1, 0)
        asked = self.temperature * (np.log(self.candidates) - self.more)
        beyond = np.maximum(TUNING.verdict.companion * evidence - asked, 0.0)
        price = companions * beyond
        odds = np.where(count > 0, self.listed + (count - 1) * self.more, 0.0)
        odds = odds - count * np.log(self.candidates) + (functions > 0) * self.nameless
        return np.asarray((evidence - price) / self.temperature + odds)


@cache
def learnt(candidates: int = 1) -> OddsCalibration:
    """What calibration.json holds, for so many listed effects."""
    table: Mapping[str, float] = json.loads(TABLE.read_text(encoding="utf-8"))
    names = [n for n in OddsCalibration.__dataclass_fields__ if n != "candidates"]
    return OddsCalibration(**{name: float(table[name]) for name in names}, candidates=candidates)
