"""What is decided: a verdict, the explanations that were weighed, and their probabilities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.model import Model

Verdict = Literal["consistent", "explained", "unlisted", "insufficient"]


@dataclass(frozen=True)
class WeighedModel:
    """A model and its log evidence above the base model's for each degree of difference
    (forms.FORMS,).
    """

    model: Model
    evidence: Array


@dataclass(frozen=True)
class Decision:
    verdict: Verdict
    best: Model
    share: float  # of the explainable misfit that the best model takes
    left: float  # nats that functions without a name could still gain
    left_significant: bool
    probability: dict[str, float]
    unlisted: float
    groups: dict[str, tuple[str, ...]]
    weighed: tuple[WeighedModel, ...] = ()
    nameless: float = -np.inf  # evidence of functions without a name [nats above the base model]
