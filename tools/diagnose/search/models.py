"""All models that were fitted in a search for effects."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from gritd.tools.diagnose.fit.model import Model, in_one_place
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.screen.evidence import Pass
from gritd.tools.diagnose.screen.screening import Screen, Screening
from gritd.tools.diagnose.search.calibration import OddsCalibration, learnt


@dataclass(frozen=True)
class EffectSearch:
    """All models that were fitted, and the screen beside the bare model.

    models: the base model first, exact in its form; then the bare model, with the discrepancy of
        form that the recordings ask for; then those with effects.
    stand: where linear algebra looks beside the bare model (`standing`), and passed, what it finds.
    failed: effects whose fit ended in a numerical failure.
    """

    screening: Screening
    models: tuple[Model, ...]
    first: Screen
    stand: Model
    passed: Pass
    failed: tuple[tuple[str, ...], ...] = ()

    @property
    def problem(self) -> Problem:
        return self.screening.problem

    @property
    def base(self) -> Model:
        """Exact in its form."""
        return self.models[0]

    @property
    def bare(self) -> Model:
        """Without effects, with the discrepancy of form that the recordings ask for."""
        return self.models[1]

    @property
    def calibration(self) -> OddsCalibration:
        """How far evidence is to be trusted here."""
        return learnt(len(self.problem.stack.rig.effects))

    def gain(self, model: Model) -> float:
        """Log evidence above the bare model's [nats]."""
        return float(model.evidence - self.bare.evidence)

    def weight(self, model: Model) -> float:
        """Log weight of a model against the bare one, by the prior of so many effects."""
        evidence, count = np.array([self.gain(model)]), np.array([len(model.names)])
        companions = np.array([in_one_place(self.problem.stack, model)])
        return float(self.calibration.weights(evidence, count, np.zeros(1), companions)[0])

    def sized(self, size: int) -> list[Model]:
        """Models of so many effects, the likeliest first."""
        return sorted((m for m in self.models if len(m.names) == size), key=lambda m: -m.evidence)

    def best(self) -> Model:
        """The likeliest model with effects, or the bare one."""
        return max(self.models[1:], key=self.weight)

    def has(self, names: Collection[str]) -> bool:
        return any(set(m.names) == set(names) for m in self.models)
