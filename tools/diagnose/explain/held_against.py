"""What is reported of the reference that a campaign is held against."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gritd.tools.cli.wording import percent
from gritd.tools.diagnose.explain.result import Diagnosis, Quantity, Reference
from gritd.tools.diagnose.explain.wording import value_of
from gritd.tools.diagnose.rig.interface import HAD, Rig
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.screen.covered import covered_share
from gritd.tools.diagnose.tuning import TUNING

NAMED = ("slip", "load", "speed", "position")


def with_reference(diagnosis: Diagnosis, rig: Rig, verdict: str | None) -> Diagnosis:
    """The result with the reference's own verdict, what it shows by itself, and how much of the new
    campaign it covers.
    """
    effects: dict[str, dict[str, Quantity]] = {}
    for constant in rig.constants:
        if constant.kind == HAD:
            effect, parameter = constant.parameter
            effects.setdefault(effect, {})[parameter] = diagnosis.nuisance[constant.name]

    stack = Stack(rig)
    reference = Reference(verdict, covered_share(stack), _outside(stack), effects)
    return replace(diagnosis, reference=reference)


def _outside(stack: Stack) -> str:
    """Covariates in which the new campaign goes beyond its reference."""
    driving = stack.covariate("speed") > 0.0
    parts = []

    for name in NAMED:
        values = stack.covariate(name)
        known, asked = values[driving & ~stack.new], values[driving & stack.new]
        low, high, share = float(known.min()), float(known.max()), TUNING.explain.beyond
        room = share * max(high - low, share * abs(float(np.mean(known))))

        ends = (asked > high + room, high, "above"), (asked < low - room, low, "below")
        for beyond, end, word in ends:
            if (part := float(np.mean(beyond))) > share:
                parts.append(f"{percent(part)} {word} {value_of(stack, name, end)}")

    return "; ".join(parts) or "nothing"
