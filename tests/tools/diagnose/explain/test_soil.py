"""The soil that is told is that of the campaign in question."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gritd.tools.diagnose.explain.soil import _told
from gritd.tools.diagnose.rig.interface import Constant

C = Constant("c", 1000.0, 200.0, "Pa", soil=True, log=True)


def _rig(*constants: Constant) -> Any:
    return SimpleNamespace(constants=constants)


def test_a_bed_prepared_anew_has_its_own_soil() -> None:
    """c of the reference 1000 e^0.2, changed by e^0.1; both σ count, and their covariance."""
    rig = _rig(C, Constant("new_c", 0.0, 0.1, changes="c"))
    mean, spread = np.array([1.0, 1.0]), np.array([[0.04, -0.01], [-0.01, 0.25]])
    told = _told(rig, C, mean, spread)

    value = 1000.0 * np.exp(0.3)
    relative = np.sqrt(0.2**2 * 0.04 + 0.1**2 * 0.25 - 2.0 * 0.2 * 0.1 * 0.01)
    assert told.value == pytest.approx(value)
    assert told.sigma == pytest.approx(value * relative)


def test_one_bed_has_one_soil() -> None:
    told = _told(_rig(C, Constant("zero", 0.0, 0.1)), C, np.array([0.5, 3.0]), np.diag([0.09, 1.0]))
    assert told.value == pytest.approx(1000.0 * np.exp(0.1))
    assert told.sigma == pytest.approx(told.value * 0.2 * 0.3)
