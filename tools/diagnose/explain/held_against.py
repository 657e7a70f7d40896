"""What is reported of the reference that a campaign is held against."""

from __future__ import annotations

from dataclasses import replace

from gritd.tools.diagnose.explain.coverage import coverage
from gritd.tools.diagnose.explain.result import Diagnosis, Quantity, Reference
from gritd.tools.diagnose.rig.interface import HAD, Rig
from gritd.tools.diagnose.rig.stack import Stack


def with_reference(diagnosis: Diagnosis, rig: Rig, verdict: str | None) -> Diagnosis:
    """The result with the reference's own verdict, what it shows by itself, and how much of the new
    campaign it covers.
    """
    effects: dict[str, dict[str, Quantity]] = {}
    for constant in rig.constants:
        if constant.kind == HAD:
            effect, parameter = constant.parameter
            effects.setdefault(effect, {})[parameter] = diagnosis.nuisance[constant.name]

    covered = coverage(Stack(rig))
    reference = Reference(verdict, covered.share, covered.outside, effects)
    return replace(diagnosis, reference=reference)
