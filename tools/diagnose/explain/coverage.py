"""How much of a new campaign lies where its reference campaign was driven."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.tools.diagnose.explain.wording import value_of
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.screen.covered import covered_share
from gritd.tools.diagnose.tuning import TUNING

NAMED = ("slip", "load", "speed", "position")


@dataclass(frozen=True)
class Coverage:
    """share: of the new campaign's values; outside: where the others lie, in words."""

    share: float
    outside: str


def coverage(stack: Stack) -> Coverage:
    """Of a rig with a reference campaign."""
    return Coverage(covered_share(stack), _outside(stack))


def _outside(stack: Stack) -> str:
    """Covariates in which the new campaign goes beyond its reference."""
    driving = stack.covariate("speed") > 0.0
    parts = []

    for name in NAMED:
        values = stack.covariate(name)
        known, asked = values[driving & ~stack.new], values[driving & stack.new]
        room = TUNING.explain.beyond * max(
            float(np.ptp(known)), TUNING.explain.beyond * abs(float(np.mean(known)))
        )

        for beyond, end, word in (
            (asked > known.max() + room, float(known.max()), "above"),
            (asked < known.min() - room, float(known.min()), "below"),
        ):
            if np.mean(beyond) > TUNING.explain.beyond:
                parts.append(f"{np.mean(beyond):.0%} {word} {value_of(stack, name, end)}")

    return "; ".join(parts) or "nothing"
