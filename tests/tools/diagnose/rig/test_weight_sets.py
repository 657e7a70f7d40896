"""Every stack of weights errs for itself, and a stated load names its stack."""

from __future__ import annotations

import numpy as np

from gritd.tools.diagnose.rig.weights import weight_sets


def test_loads_a_hundredth_apart_are_two_stacks() -> None:
    found = weight_sets([np.full(50, 174.0), np.full(50, 176.0), np.full(50, 174.0)])
    assert found.loads == (174.0, 176.0)
    assert [set(label.tolist()) for label in found.label] == [{0}, {1}, {0}]
    assert len(set(found.names)) == 2


def test_one_load_that_is_written_twice_is_one_stack() -> None:
    found = weight_sets([np.full(50, 100.0), np.full(50, 100.0001), np.full(50, 60.0)])
    assert len(found.loads) == 2
