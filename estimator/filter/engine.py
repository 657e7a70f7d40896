"""What applies a measurement to an estimate: two engines with one interface.

`filterpy_engine` is filterpy's ExtendedKalmanFilter, and the reference; `plain_engine`, the
default, is the same algebra with every sum in a stated order, compiled where it was built. A test
holds them equal.
"""

from __future__ import annotations

from typing import Protocol

from gritd.estimator.compiled import arithmetic
from gritd.estimator.config.settings import ENGINES
from gritd.estimator.filter.estimate import Estimate, Update
from gritd.estimator.filter.plain_engine import CompiledEngine, PlainEngine


class Engine(Protocol):
    """Holds no estimate of its own."""

    def update(self, estimate: Estimate, update: Update) -> Estimate:
        """Apply a measurement. Raises ZeroDivisionError where its innovations have no spread."""


def make_engine(name: str) -> Engine:
    """The engine of this name, of settings.ENGINES."""
    if name not in ENGINES:
        raise ValueError(f"no engine {name!r}; expected one of {', '.join(ENGINES)}")

    if name == "plain":
        return CompiledEngine() if arithmetic.BUILT else PlainEngine()

    # loads scipy.stats too: 0.9 s and 60 MB, which nobody pays who uses the other engine
    from gritd.estimator.filter.filterpy_engine import FilterpyEngine

    return FilterpyEngine()
