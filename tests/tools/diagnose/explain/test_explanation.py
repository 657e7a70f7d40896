"""What remains, and parameters with their σ."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gritd.estimator.effects.stribeck_friction import StribeckFriction
from gritd.tools.diagnose.explain.explanation import _remaining, parameters
from gritd.tools.diagnose.explain.result import Remainder
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Free


@pytest.mark.parametrize("verdict", ["explained", "unlisted"])
@pytest.mark.parametrize("formed", [True, False])
def test_what_the_names_leave_is_told_in_the_unit_that_is_shown(formed: bool, verdict: str) -> None:
    decision: Any = SimpleNamespace(verdict=verdict, beside=None)
    left = {
        "torque": Remainder(0.001, "N·m", "within the noise"),
        "sinkage": Remainder(0.0046, "m", "−2.8 mm at 5 % slip, +6.8 mm at 49 % slip"),
    }
    rig: Any = SimpleNamespace(forms=("soil",) if formed else (), units={})
    shown = _remaining(rig, decision, False, left)
    who = "Without its discrepancy of form, the model" if formed else "The model"
    assert shown == (f"{who} misses sinkage by 4.6 mm (−2.8 mm at 5 % slip, +6.8 mm at 49 % slip).")
    nothing = _remaining(rig, decision, False, {})
    assert ("noise" in nothing) == (verdict == "explained"), "a misfit that constants take up"


def test_a_strength_is_as_uncertain_as_its_form_makes_it() -> None:
    """The fit knows it as if our formula were exact; what is no strength has one meaning."""
    excess, speed = StribeckFriction.parameters()
    free = tuple(Free(StribeckFriction, p, "stribeck_friction") for p in (excess, speed))
    x = np.array([2.0 / excess.sigma, 0.0])
    sigma = np.array([0.3 / excess.sigma, 0.1])
    model: Any = SimpleNamespace(fitted=SimpleNamespace(free=free), parameters=lambda: (x, sigma))
    rig: Any = SimpleNamespace(unit_factors={})

    exact = parameters(rig, model, "stribeck_friction")
    shown = parameters(rig, model, "stribeck_friction", forms=0.2)
    assert (shown["excess"].value, shown["excess"].sigma) == pytest.approx((2.0, 0.5))
    assert exact["excess"].sigma == pytest.approx(0.3)
    assert shown["speed"] == exact["speed"]


def test_a_parameter_at_its_bound_is_not_known_exactly() -> None:
    fitted: Any = SimpleNamespace(
        u=np.zeros(1),
        x=np.array([0.0, 1.0]),
        sigma=np.array([1.0, 0.4, 0.3]),
        held=np.array([False, True, False]),
    )
    marginal: Any = SimpleNamespace(
        moments=lambda chosen, wanted: (np.array([0.0, 1.1]), np.diag([0.0, 0.04]))
    )
    mean, sigma = Model(fitted, marginal=marginal).parameters()
    assert mean.tolist() == [0.0, 1.1]
    assert sigma.tolist() == pytest.approx([0.4, 0.2])
