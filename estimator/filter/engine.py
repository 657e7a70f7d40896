"""What applies a measurement to an estimate: two engines with one interface.

`filterpy_engine` is filterpy's ExtendedKalmanFilter with the Schmidt gain, and the reference;
`plain_engine`, the default, is the same algebra in plain floats, compiled where it was built. All
use the Joseph form with the gain that was really applied, zeroed rows included, so the covariance
stays symmetric and positive. A test holds them equal.
"""

from __future__ import annotations

from typing import Protocol

from gritd.estimator.compiled import arithmetic
from gritd.estimator.config.settings import ENGINES
from gritd.estimator.filter.estimate import Estimate, Update, Vector
from gritd.estimator.filter.plain_engine import CompiledEngine, PlainEngine


class Engine(Protocol):
    """Knows the nuisances' variances and holds no estimate of its own."""

    def update(self, estimate: Estimate, update: Update, consider_k: bool) -> Estimate:
        """Apply a measurement. With consider_k, ln k keeps its value and variance."""


def make_engine(name: str, nuisance_variances: Vector) -> Engine:
    """The engine of this name, of settings.ENGINES, for nuisances of the variances (q,)."""
    if name not in ENGINES:
        raise ValueError(f"no engine {name!r}; expected one of {', '.join(ENGINES)}")

    if name == "plain":
        return (CompiledEngine if arithmetic.BUILT else PlainEngine)(nuisance_variances)

    # loads scipy.stats too: 0.9 s and 60 MB, which nobody pays who uses the other engine
    from gritd.estimator.filter.filterpy_engine import FilterpyEngine

    return FilterpyEngine(nuisance_variances)
