"""The bounds of c, tan φ and ln k, and for how long an estimate stands at one."""

from __future__ import annotations

from math import log

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.bank import Bank
from gritd.estimator.filter.estimate import KPA, STATES, Estimate, Vector, project
from gritd.estimator.filter.trust import Trust
from gritd.estimator.filter.tuning import TRUST


class Bounds:
    """The configured bounds together with the prior: mean and σ (3,)."""

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

    def all_inside(self, bank: Bank) -> Bank:
        """Every member moved to the bound where it left it."""
        return tuple([self.inside(member) for member in bank])

    def stood(self, trust: Trust, estimate: Estimate, elapsed: float = 0.0) -> Trust:
        """For how long an estimate has stood at a bound, `elapsed` [s] of driving later."""
        at_bound = trust.at_bound + elapsed if self.improbable(estimate) else 0.0
        return trust if at_bound == trust.at_bound else trust._replace(at_bound=at_bound)

    def reached(self, estimate: Estimate) -> tuple[int, ...]:
        """Which states stand at a bound."""
        pairs = zip(estimate.x[:STATES], self._bounds, strict=True)
        return tuple([at for at, (value, bounds) in enumerate(pairs) if value in bounds])

    def improbable(self, estimate: Estimate) -> bool:
        """Whether a state stands at a bound that the prior calls improbable."""
        return any(
            [
                value in bounds and abs(value - mean) > TRUST.improbable * sigma
                for value, bounds, mean, sigma in zip(
                    estimate.x[:STATES], self._bounds, self._mean, self._sigma, strict=True
                )
            ]
        )
