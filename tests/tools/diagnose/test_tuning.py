"""Every tuned number of the diagnosis stands in one place, with its reason."""

from __future__ import annotations

import ast
from dataclasses import fields
from pathlib import Path

import pytest

from gritd.tools.diagnose.tuning import TUNING

EVERY = [f.name for f in fields(TUNING)]
ROOMS = [name for name in EVERY if name != "numerics"]  # which no result follows
DIAGNOSE = Path(__file__).parents[3] / "tools" / "diagnose"


@pytest.mark.parametrize("room", ROOMS)
def test_every_number_says_its_unit_its_reason_and_what_it_was_learnt_from(room: str) -> None:
    for number in fields(getattr(TUNING, room)):
        for what in ("unit", "reason", "learnt"):
            assert number.metadata.get(what), f"{room}.{number.name}: no {what}"


@pytest.mark.parametrize("room", EVERY)
def test_every_number_is_read_by_a_room(room: str) -> None:
    texts = [p.read_text(encoding="utf-8") for p in DIAGNOSE.rglob("*.py")]
    for number in fields(getattr(TUNING, room)):
        name = f"{room}.{number.name}"
        own = f"self.{number.name}"  # of what is computed of the numbers
        assert any(f"TUNING.{name}" in t or own in t for t in texts), f"{name} is read by nothing"


def test_no_room_keeps_a_number_of_its_own() -> None:
    """Numbers that stay: units, a turn, nothing, and what a name means."""
    kept = {"NS", "_NONE", "TURN", "TINY", "WINDOW", "PIECE"}
    found = set()
    for path in DIAGNOSE.rglob("*.py"):
        if "tuning" in path.parts:
            continue
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.Assign) and _number(node.value):
                names = {n.id for t in node.targets for n in ast.walk(t) if isinstance(n, ast.Name)}
                found |= names
    assert found <= kept


def _number(value: ast.expr) -> bool:
    """A number, several of them, or what is computed of numbers alone."""
    numbers = [n for n in ast.walk(value) if isinstance(n, ast.Constant)]
    return bool(numbers) and all(
        isinstance(n.value, int | float) and not isinstance(n.value, bool) for n in numbers
    )
