"""The base model: soil and calibration fitted to the recordings, first roughly, then in their own
noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.tools.diagnose.fit.discrepancy import form_freedoms
from gritd.tools.diagnose.fit.functions import smooth_signatures, tolerance
from gritd.tools.diagnose.fit.model import Model, fit_model, plain_model
from gritd.tools.diagnose.fit.problem import Fitted, Problem
from gritd.tools.diagnose.fit.signatures import raw_signatures, ripple_columns
from gritd.tools.diagnose.noise.colour import Noise
from gritd.tools.diagnose.noise.estimate import first_guess
from gritd.tools.diagnose.noise.saturated import Explainable
from gritd.tools.diagnose.rig.interface import Stack
from gritd.tools.diagnose.tuning import TUNING


@dataclass(frozen=True)
class BaseFit:
    """The recordings with their noise, and the model without any further effect fitted to them."""

    problem: Problem
    model: Model

    @property
    def fitted(self) -> Fitted:
        return self.model.fitted


def fit_roughly(stack: Stack) -> BaseFit:
    """In white noise, to linearise about."""
    start = np.zeros(len(stack.rig.constants))
    noise = first_guess(stack, stack.predict(start))

    problem = Problem(stack, noise, tolerance(stack, TUNING.fit.tolerance))
    return BaseFit(
        problem, Model(problem.descend((), (), start, np.zeros(0), TUNING.fit.rough_rounds))
    )


def explainable(rough: BaseFit) -> Explainable:
    """What constants, effects and smooth functions could explain about a rough fit: no noise."""
    stack, fitted = rough.problem.stack, rough.fitted
    rippling = {
        n
        for n, e in stack.rig.effects.items()
        if any(p.scan and not p.unit for p in e.parameters())
    }
    others = [name for name in stack.rig.effects if name not in rippling]

    signatures = raw_signatures(stack, fitted.u, fitted.predicted, others)
    leading = [s.columns for s in (*signatures, *smooth_signatures(stack))]
    ripples = ripple_columns(stack, stack.measured - fitted.predicted)
    return Explainable(np.column_stack([*leading, fitted.raw]), ripples)


def formed(rough: BaseFit) -> Explainable:
    """What constants and the discrepancy of form could explain about a rough fit."""
    stack = rough.problem.stack
    forms = [f.columns for f in form_freedoms(stack, rough.problem.noise)]
    return Explainable(rough.fitted.raw, np.column_stack([np.zeros((stack.size, 0)), *forms]))


def refit_with_form(rough: BaseFit, noise: Noise) -> BaseFit:
    """In the noise that was found, the discrepancy of form learnt from both campaigns together."""
    problem = _problem(rough, noise)
    forms = form_freedoms(problem.stack, noise)
    start = (rough.fitted.u, np.zeros(0))
    return BaseFit(problem, fit_model(problem, forms, (), (), start, tuple(0 for _ in forms)))


def refit(rough: BaseFit, noise: Noise) -> BaseFit:
    """In the noise that was found, what each run does for itself allowed."""
    problem = _problem(rough, noise)
    fitted = problem.descend((), (), rough.fitted.u, np.zeros(0))
    return BaseFit(problem, plain_model(problem, fitted))


def _problem(rough: BaseFit, noise: Noise) -> Problem:
    """Without freedoms, what each run does for itself allowed."""
    allowed = tolerance(rough.problem.stack, TUNING.fit.tolerance)
    return Problem(rough.problem.stack, noise, np.column_stack((allowed, noise.of_runs)))
