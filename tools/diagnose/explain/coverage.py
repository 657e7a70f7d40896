"""How much of a new campaign lies where its reference campaign was driven."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.estimator.model.discrepancy import features_of
from gritd.tools.diagnose.explain.wording import value_of
from gritd.tools.diagnose.rig.interface import Stack

KNOWN = 0.3  # share of the discrepancy's variance that the reference may leave open
MOST, LEAST = 120, 0.02  # inducing points; variance at which there are enough
NAMED = ("slip", "load", "speed", "position")
BEYOND = 0.02  # share of the range beyond which a covariate is outside
SLIGHT = 0.02  # share of the values that must be beyond to be told


@dataclass(frozen=True)
class Coverage:
    """share: of the new campaign's values; outside: where the others lie, in words."""

    share: float
    outside: str


def coverage(stack: Stack) -> Coverage:
    """Of a rig with a reference campaign."""
    source = stack.rig.forms[0]
    new = np.array(stack.rig.new)
    pairs = list(zip(source.conditions, source.weight, new, strict=True))
    known, asked = (
        np.vstack([c[w != 0.0] for c, w, n in pairs if n == which]) for which in (False, True)
    )
    features = features_of(known, MOST, LEAST)
    left = 1.0 - np.sum(features.at(asked) ** 2, axis=1)
    return Coverage(float(np.mean(left < KNOWN)), _outside(stack))


def _outside(stack: Stack) -> str:
    """Covariates in which the new campaign goes beyond its reference."""
    driving = stack.covariate("speed") > 0.0
    parts = []
    for name in NAMED:
        values = stack.covariate(name)
        known, asked = values[driving & ~stack.new], values[driving & stack.new]
        room = BEYOND * max(float(np.ptp(known)), 0.02 * abs(float(np.mean(known))))
        for beyond, end, word in (
            (asked > known.max() + room, float(known.max()), "above"),
            (asked < known.min() - room, float(known.min()), "below"),
        ):
            if np.mean(beyond) > SLIGHT:
                parts.append(f"{np.mean(beyond):.0%} {word} {value_of(stack, name, end)}")
    return "; ".join(parts) or "nothing"
