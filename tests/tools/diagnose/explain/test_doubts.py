"""What a reader should doubt is told, and no more."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

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
    rig: Any = SimpleNamespace(constants=[SimpleNamespace(name="c")])
    assert doubts(rig, SimpleNamespace(fitted=fitted)) == (  # type: ignore[arg-type]
        "At its bound: ratio of rear_contact is 1.",
        "At its bound: breadth of rear_contact is 0.",
    )
