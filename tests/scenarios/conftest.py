"""Figures: a scenario states what it measured; `python -m tools.reliability` makes docs/reliability.md from them."""

from __future__ import annotations

import json
import os

import pytest

SEEDS = (1, 2, 3)
FIGURES = "GRITD_FIGURES"  # file that collects what is measured, one JSON line each


def pytest_generate_tests(metafunc):
    """A scenario that takes a seed is run with three; where it needs the daemon, two of them count as slow."""
    if "seed" in metafunc.fixturenames:
        others = SEEDS[1:] if getattr(metafunc.module, "QUICK", False) else map(slow, SEEDS[1:])
        metafunc.parametrize("seed", [SEEDS[0], *others])


def slow(seed):
    return pytest.param(seed, marks=pytest.mark.slow)


@pytest.fixture
def figure(request):
    """figure(row, level, name, value, unit, limit, slack): print what was measured, keep it, hold it to its limit.

    row: the fault, as the list names it. level: what ran, and what was simulated. limit: largest value allowed;
    slack: how many times that before the test fails, for times that a busy machine decides.
    """

    def state(row, level, name, value, unit="", limit=None, slack=1.0):
        print(f"{row}: {name} {value:.4g} {unit}".rstrip() + (f" (limit {limit:g})" if limit is not None else ""))
        if path := os.environ.get(FIGURES):
            entry = {"row": row, "level": level, "name": name, "value": float(value), "unit": unit, "limit": limit}
            with open(path, "a", encoding="utf-8") as out:
                out.write(json.dumps({**entry, "test": request.node.nodeid}, ensure_ascii=False) + "\n")
        assert limit is None or value <= slack * limit, f"{name} is {value:g} {unit}, above {limit:g}"

    return state
