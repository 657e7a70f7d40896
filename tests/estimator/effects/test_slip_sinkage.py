"""Three published laws of slip-sinkage."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.config import packaged
from gritd.estimator.config import configuration as config
from gritd.estimator.effects import EFFECTS, make
from gritd.estimator.terramechanics.soil import Soil

SOIL = Soil(1000.0, 0.6, 0.025, 1.1, 1.5e6)
SLIPS = st.floats(-1.0, 1.0)


@given(SLIPS, st.floats(0.0, 2.0), st.floats(1e-3, 0.05))
def test_a_plate_under_given_pressure_sinks_by_lyaskos_factor(
    slip: float, share: float, sinkage: float
) -> None:
    """σ = K zⁿ: what was needed for z is needed for z (1 + s [(1 + |i|)/(1 − |i|/2) − 1])."""
    situation = cast(Any, SimpleNamespace(slip=np.array([slip])))
    changed = make("slip_sinkage", {"deepening": share}).soil(SOIL, situation)
    factor = 1.0 + share * ((1.0 + abs(slip)) / (1.0 - 0.5 * abs(slip)) - 1.0)
    pressure = SOIL.modulus * sinkage**SOIL.exponent
    assert changed.modulus * (factor * sinkage) ** changed.exponent == pytest.approx(pressure)


def test_the_diagnosis_finds_no_wheel_that_rises_with_slip_but_older_recordings_are_read() -> None:
    growth = next(p for p in EFFECTS["slip_sinkage"].parameters() if p.name == "growth")
    assert growth.low == 0.0
    text = packaged().read_text(encoding="utf-8")
    assert text.count("\neffects:\n") == 1
    text = text.replace("\neffects:\n", "\neffects:\n  slip_sinkage:\n    growth: -0.05\n")
    (effect,) = (
        e for e in config.loads(text, "testbed.yaml").settings.effects if e.name == "slip_sinkage"
    )
    assert effect.parameters["growth"].value == -0.05
