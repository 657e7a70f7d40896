"""What has no name: functions of time and place, waves and steps that act beside a model.

They compete with the listed effects. Smooth functions of the conditions are not among them: those
are the discrepancy of form, which every model has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gritd.tools.diagnose.fit.evidence import Signature
from gritd.tools.diagnose.fit.model import Model, fit_model
from gritd.tools.diagnose.fit.random_effect import even, random_effect
from gritd.tools.diagnose.fit.selection import parts_of, take_up
from gritd.tools.diagnose.screen.scans import without_harmonics
from gritd.tools.diagnose.screen.screening import Screening
from gritd.tools.diagnose.tuning import TUNING


@dataclass(frozen=True, eq=False)
class UnexplainedTerms:
    """Functions beside a model, fitted with everything else; gain: log evidence above the model's,
    the number of functions that were tried counted.
    """

    model: Model
    functions: tuple[Signature, ...]
    gain: float


def unexplained_with(screening: Screening, model: Model) -> UnexplainedTerms | None:
    """The functions that act together beside a model, one taken up after the other, while each
    gains by linear algebra more than the choice among all costs; None where none pays for itself.
    """
    functions = screening.shapes(model)
    if not functions:
        return None
    beside = without_harmonics(screening.problem, model.fitted)
    kinds = float(np.log(len({s.of for s in functions})))
    parts = parts_of(beside, screening.problem.noise, functions, kinds)
    taken = take_up(parts, range(len(functions)), TUNING.verdict.together).parts
    if not taken:
        return None

    chosen = [functions[k] for k in taken]
    best = _fitted(screening, model, chosen)
    gain = best.evidence - model.evidence + sum(parts.prior[k] for k in taken)
    return UnexplainedTerms(best, tuple(chosen), gain) if gain > 0.0 else None


def _fitted(screening: Screening, model: Model, chosen: Sequence[Signature]) -> Model:
    """With functions of a size that the recordings tell."""
    problem, fitted = screening.problem, model.fitted
    columns = np.column_stack([s.columns for s in chosen])
    functions = random_effect(
        "unexplained", columns, problem.noise, even(TUNING.fit.strength_sizes)
    )

    return fit_model(
        problem,
        (*screening.forms, functions),
        fitted.effects,
        fitted.free,
        (fitted.u, fitted.x),
        (*model.sizes, 0),
        model.other_forms,
        fitted,
    )
