"""The bounds of c, tan φ and ln k, and for how long an estimate stands at one."""

from __future__ import annotations

from math import log

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.estimate import KPA, Estimate, Vector, project
from gritd.estimator.filter.track import TrackState
from gritd.estimator.filter.tuning import TRUST


class Bounds:
    """The configured bounds beside the prior: mean and σ (3,)."""

    def __init__(self, settings: Settings, mean: Vector, sigma: Vector) -> None:
        low_c, high_c = settings.filter.cohesion_bounds
        low_k, high_k = settings.filter.shear_modulus_bounds
        self._bounds = (
            (low_c / KPA, high_c / KPA),
            settings.filter.tan_phi_bounds,
            (log(low_k), log(high_k)),
        )
        self._mean, self._sigma = mean, sigma

    def inside(self, estimate: Estimate) -> Estimate:
        """The estimate moved to the bound where it left it."""
        return project(estimate, self._bounds)

    def moved(self, state: TrackState, estimate: Estimate, elapsed: float = 0.0) -> TrackState:
        """The state with another estimate inside its bounds, `elapsed` [s] of driving later."""
        estimate = self.inside(estimate)
        at_bound = state.trust.at_bound + elapsed if self.improbable(estimate) else 0.0
        return state._replace(estimate=estimate, trust=state.trust._replace(at_bound=at_bound))

    def improbable(self, estimate: Estimate) -> bool:
        """Whether a state stands at a bound that the prior calls improbable."""
        return any(
            [
                value in bounds and abs(value - mean) > TRUST.improbable * sigma
                for value, bounds, mean, sigma in zip(
                    estimate.x, self._bounds, self._mean, self._sigma, strict=True
                )
            ]
        )
