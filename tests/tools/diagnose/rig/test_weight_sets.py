"""Every stack of weights errs for itself, and a stated load names its stack."""

from __future__ import annotations

import numpy as np

from gritd.tools.diagnose.rig.weights import Weights, weight_sets


def _held(count: int, load: float) -> Weights:
    return Weights(np.full(count, load))


def test_loads_a_hundredth_apart_are_two_stacks() -> None:
    found = weight_sets([_held(50, 174.0), _held(50, 176.0), _held(50, 174.0)])
    assert found.loads == (174.0, 176.0)
    assert [set(label.tolist()) for label in found.label] == [{0}, {1}, {0}]
    assert len(set(found.names)) == 2


def test_one_load_that_is_written_twice_is_one_stack() -> None:
    found = weight_sets([_held(50, 100.0), _held(50, 100.0001), _held(50, 60.0)])
    assert len(found.loads) == 2


def test_what_a_sensor_tells_is_no_stack() -> None:
    measured = [np.full(50, load) for load in (60.0, 100.0)]
    assert not weight_sets([Weights(load, load) for load in measured]).loads
