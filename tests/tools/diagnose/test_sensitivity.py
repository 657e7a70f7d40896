"""What halved and doubled numbers change: those of numerical methods nothing, together or alone.

`python -m pytest -m slow -s tests/tools/diagnose/test_sensitivity.py` prints what each tuned number
moves in one short run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np
import pytest

from gritd.estimator.effects import make
from gritd.tools.diagnose.explain.result import Diagnosis
from gritd.tools.diagnose.tuning import TUNING, replaced
from tests.tools.diagnose.campaigns import diagnosed, plan

FACTORS = (0.5, 2.0)
SHARES = ("share", "probability", "quantile")  # they stay below 1
ROOMS = [f.name for f in fields(TUNING) if f.name != "numerics"]
NUMBERS = [
    (room, f.name, f.metadata["unit"])
    for room in ROOMS
    for f in fields(getattr(TUNING, room))
    if f.metadata["unit"] not in ("prior", "choice")
]


def _times(value: Any, factor: float, share: bool) -> Any:
    """Every number of a value; whole ones stay whole, shares change in their odds."""
    if isinstance(value, Mapping):
        return {name: _times(each, factor, share) for name, each in value.items()}
    if isinstance(value, tuple):
        return tuple(_times(each, factor, share) for each in value)
    if isinstance(value, int):
        return max(round(factor * value), 1)
    return value * factor / (1.0 - value + value * factor) if share else value * factor


@cache
def _found(factor: float) -> Diagnosis:
    """With all numbers of numerical methods times a factor."""
    of = TUNING.numerics
    every = {f.name: _times(getattr(of, f.name), factor, f.name == "good") for f in fields(of)}
    with replaced("numerics", **every):
        return diagnosed(plan(), (make("stribeck_friction", {}),))


@pytest.mark.long
@pytest.mark.parametrize("factor", FACTORS)
def test_half_or_twice_the_effort_finds_the_same(factor: float) -> None:
    usual, other = _found(1.0), _found(factor)
    assert other.verdict == usual.verdict
    assert [h.effect for h in other.accepted] == [h.effect for h in usual.accepted]
    assert usual.soil is not None and other.soil is not None
    for name in ("c", "tan_phi"):
        known = usual.soil.after[name]
        assert other.soil.after[name].value == pytest.approx(known.value, abs=0.1 * known.sigma)


@cache
def _usual() -> Diagnosis:
    return _short()


def _short() -> Diagnosis:
    drawn = plan(loads=(60.0,), seconds=6.0, standstill=False, wrench=False)
    with np.errstate(all="ignore"):
        return diagnosed(drawn, (make("sinkage_datum", {"offset": 0.006}),))


@pytest.mark.slow
@pytest.mark.parametrize("factor", FACTORS)
@pytest.mark.parametrize(("room", "name", "unit"), NUMBERS)
def test_a_diagnosis_ends_whatever_a_number_is(
    room: str, name: str, unit: str, factor: float
) -> None:
    before, value = _usual(), getattr(getattr(TUNING, room), name)
    with replaced(room, **{name: _times(value, factor, unit in SHARES)}):
        after = _short()

    assert before.soil is not None and after.soil is not None
    known, other = before.soil.after["tan_phi"], after.soil.after["tan_phi"]
    assert np.isfinite(other.value) and other.sigma > 0.0
    moved = (other.value - known.value) / known.sigma
    if after.verdict != before.verdict or abs(moved) > 0.1:
        print(f"{room}.{name} × {factor}: {before.verdict} → {after.verdict}, tan φ {moved:+.1f} σ")
