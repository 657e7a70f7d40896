"""What a reader should doubt is reported, and no more."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gritd.tools.diagnose.explain.doubts import doubts


def _parameter(name: str, role: str) -> SimpleNamespace:
    parameter = SimpleNamespace(name=name, role=role, unit="")
    return SimpleNamespace(name="rear_contact", parameter=parameter, value=lambda x: 2.0 * x)


def test_every_parameter_at_its_bound_is_told_but_a_strength_at_nought() -> None:
    free = [_parameter("ratio", "strength"), _parameter("other", "strength")]
    free += [_parameter("breadth", "shape"), _parameter("inside", "shape")]
    fitted: Any = SimpleNamespace(
        u=np.zeros(1),
        x=np.array([0.5, 0.0, 0.0, 0.3]),
        held=np.array([False, True, True, True, False]),
        free=free,
        converged=True,
    )
    rig: Any = SimpleNamespace(constants=[SimpleNamespace(name="c")], channels=(), tabled=False)
    assert doubts(rig, _model(fitted), SimpleNamespace(colours=())) == (
        "At its bound: ratio of rear_contact is 1.",
        "At its bound: breadth of rear_contact is 0.",
    )


@pytest.mark.parametrize(("sigma", "shown"), [(0.7e-3, 0), (7.7e-3, 1)])
def test_noise_far_above_what_is_stated_is_told(sigma: float, shown: int) -> None:
    """0.25 mm is stated of a reading: a grid value, a mean of some, should scatter less."""
    rig: Any = SimpleNamespace(
        constants=[],
        channels=("sinkage",),
        units={"sinkage": "m"},
        stated_noise={"sinkage": 2.5e-4},
        tabled=False,
    )
    fitted: Any = SimpleNamespace(
        u=np.zeros(0), x=np.zeros(0), held=np.zeros(0, bool), free=[], converged=True
    )
    noise: Any = SimpleNamespace(colours=(SimpleNamespace(sigma=sigma),))
    sentences = doubts(rig, _model(fitted), noise)
    assert len(sentences) == shown
    assert all("7.7 mm, 31 times" in s and "0.25 mm" in s for s in sentences)


def _model(fitted: Any) -> Any:
    return SimpleNamespace(fitted=fitted)
