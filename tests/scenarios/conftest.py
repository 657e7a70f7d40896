"""Figures: a scenario states what it measured; `python -m gritd.tools.dev.reliability` makes
docs/reliability.md from them.
"""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path

import pytest

SEEDS = (1, 2, 3)
FIGURES = "GRITD_FIGURES"  # file that collects what is measured, one JSON line each


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Every scenario is a whole run."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.long)


def pytest_generate_tests(metafunc):
    """A scenario that takes a seed is run with three; where it needs the daemon, two of them count
    as slow.
    """
    if "seed" in metafunc.fixturenames:
        others = SEEDS[1:] if getattr(metafunc.module, "QUICK", False) else map(slow, SEEDS[1:])
        metafunc.parametrize("seed", [SEEDS[0], *others])


def slow(seed):
    return pytest.param(seed, marks=pytest.mark.slow)


@pytest.fixture
def figure(request):
    """figure(row, level, name, value, unit, limit, real): print what was measured, keep it, hold it
    to its limit.

    row: the fault, as the list names it. level: what ran, and what was simulated. limit: largest
        value allowed;
    real: a time in the real world, which a machine that stalls decides as well as we do. A test
    that fails for it says nothing, so it is stated, and `python -m gritd.tools.dev.reliability`
    holds it to its limit.
    """

    def state(row, level, name, value, unit="", limit=None, real=False):
        print(
            f"{row}: {name} {value:.4g} {unit}".rstrip()
            + (f" (limit {limit:g})" if limit is not None else "")
        )
        if path := os.environ.get(FIGURES):
            entry = {
                "row": row,
                "level": level,
                "name": name,
                "value": float(value),
                "unit": unit,
                "limit": limit,
            }
            more = {"real": real, "load": os.getloadavg()[0], "test": request.node.nodeid}
            with open(path, "a", encoding="utf-8") as out:
                out.write(json.dumps({**entry, **more}, ensure_ascii=False) + "\n")
        assert limit is None or real or value <= limit, (
            f"{name} is {value:g} {unit}, above {limit:g}"
        )

    return state


@pytest.fixture
def folder_of_nobody():
    """Below /tmp: pytest's own folders are closed to others."""
    with tempfile.TemporaryDirectory() as name:
        os.chmod(name, 0o755)
        yield Path(name)
