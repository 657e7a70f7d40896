"""Misfits without a name: which are looked for."""

from __future__ import annotations

import numpy as np

from gritd.tools.diagnose.fit.functions import smooth_signatures
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings


def test_a_misfit_along_the_motors_heat_is_looked_for_in_what_the_motor_tells_alone() -> None:
    """A force sensor knows nothing of the motor's heat: there such a misfit goes with time."""
    stack = Stack(wheel_rig(record(plan(), ()), settings()))
    along: dict[tuple[str, ...], set[str]] = {}
    for signature in smooth_signatures(stack):
        shape = signature.shape
        along.setdefault(shape.along, set()).add(shape.channel)
        assert np.any(signature.columns[stack.of(shape.channel)])

    assert {"torque", "drawbar_pull", "sinkage"} <= along[("time",)]
    assert along[("heat",)] == {"torque"} == set(stack.rig.heated)
