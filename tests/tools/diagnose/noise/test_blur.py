"""What averages and slopes of a moving wheel blur, and how much the blurred values tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from gritd.tools.diagnose.noise.blur import blur_of
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.rig.wheel import wheel_rig
from gritd.tools.proof.ours.cases import record
from tests.tools.diagnose.campaigns import plan, settings


def blur_of_first(loads: Sequence[float]) -> float:
    """Root mean square blur of the first run's pull [N]; one run a load."""
    stack = Stack(wheel_rig(record(plan(loads, 12.0, noise=0.0), ()), settings()))
    blur = blur_of(stack, stack.predict(np.zeros(len(stack.rig.constants))))
    return float(np.sqrt(np.mean(blur[stack.of("drawbar_pull") & (stack.run == 0)] ** 2)))


def test_runs_that_are_repeated_tell_no_more_of_a_change_than_one_set_of_them() -> None:
    """The blur is an error of the model: it is the same in all of them, and their mean has it in
    full. In the second six runs orders and speeds come again.
    """
    for_one, for_all = blur_of_first((70.0,) * 6) / np.sqrt(6.0), blur_of_first((70.0,) * 12)
    assert for_all / np.sqrt(12.0) == pytest.approx(for_one, rel=0.05)


def test_runs_under_other_loads_are_no_repetition() -> None:
    assert blur_of_first((40.0, 70.0, 100.0)) == pytest.approx(blur_of_first((40.0,)), rel=0.05)


def test_steady_states_have_no_change_between_them() -> None:
    rig = replace(wheel_rig(record(plan(seconds=12.0), ()), settings()), tabled=True)
    stack = Stack(rig)
    assert not blur_of(stack, stack.measured).any()
