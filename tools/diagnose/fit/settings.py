"""A model beside which candidates are judged, with smaller discrepancies too.

A discrepancy of form that was learnt without an effect may have taken the effect's part. So each
candidate is judged beside smaller discrepancies as well, at what these cost the model alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.marginal import Chosen
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.fit.projection import ResizedProjections


@dataclass(frozen=True)
class Settings:
    """A model with several sizes of its forms; costs: log evidence that the model alone loses by
    each [nats].
    """

    sizes: Sequence[Chosen]
    costs: Sequence[float]
    projections: ResizedProjections

    def project(self, columns: Array) -> Iterator[tuple[Chosen, float, Array, Array]]:
        """Of whitened columns (N, m) for each of the sizes: these, their cost, A (m, m), b (m,)."""
        projected = self.projections.project(columns)
        for sizes, cost, (a, b) in zip(self.sizes, self.costs, projected, strict=True):
            yield sizes, cost, a, b


def settings_of(problem: Problem, model: Model) -> Settings:
    """The model as it is, then with smaller forms."""
    marginal, bends, fitted = model.marginal, model.chosen[len(model.sizes) :], model.fitted
    if marginal is None:
        as_it_is = np.ones(fitted.penalty.size)
        return Settings([model.sizes], [0.0], fitted.resized([as_it_is]))

    freedoms = marginal.freedoms
    every = fitted.allowed(problem.with_freedoms(freedoms, [1.0] * len(freedoms)).allowance)
    own = np.ones(every.penalty.size - sum(f.columns.shape[1] for f in freedoms))

    smaller = _smaller(model.sizes)
    costs, factors = [], []
    for chosen in ((*sizes, *bends) for sizes in smaller):
        values = [f.sizes.values[n] for f, n in zip(freedoms, chosen, strict=True)]
        sized = [np.full(f.columns.shape[1], v) for f, v in zip(freedoms, values, strict=True)]
        factors.append(np.concatenate((own, *sized)))
        costs.append(marginal.log_evidence(model.chosen) - marginal.log_evidence(chosen))
    return Settings(smaller, costs, every.resized(factors))


def _smaller(sizes: Chosen) -> list[Chosen]:
    """Sizes as they are, all smaller by steps, and each alone at its smallest."""
    steps = [tuple(max(n - k, 0) for n in sizes) for k in range(max(sizes, default=0) + 1)]
    alone = [(*sizes[:i], 0, *sizes[i + 1 :]) for i in range(len(sizes))]
    return list(dict.fromkeys([*steps, *alone]))
