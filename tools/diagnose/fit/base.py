"""The base model: soil and calibration fitted to the recordings, first roughly, then in their own
noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.discrepancy import form_terms, of_differences
from gritd.tools.diagnose.fit.functions import smooth_signatures, tolerance
from gritd.tools.diagnose.fit.marginal import Chosen
from gritd.tools.diagnose.fit.model import Model, fit_model, plain_model, sized_model
from gritd.tools.diagnose.fit.problem import Fitted, Problem
from gritd.tools.diagnose.fit.random_effect import RandomEffect
from gritd.tools.diagnose.fit.ripples import line_columns
from gritd.tools.diagnose.fit.signatures import raw_signatures
from gritd.tools.diagnose.noise.colour import Noise
from gritd.tools.diagnose.noise.estimate import first_guess
from gritd.tools.diagnose.noise.saturated import Explainable
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING


@dataclass(frozen=True)
class BaseFit:
    """The recordings with their noise, and the model without any further effect fitted to them."""

    problem: Problem
    model: Model
    forms: tuple[RandomEffect, ...] = ()  # what the form of the model may be off by
    usual: Array | None = None  # (q,) constants as a reference alone tells them

    @property
    def fitted(self) -> Fitted:
        return self.model.fitted


def fit_roughly(stack: Stack) -> BaseFit:
    """In white noise, to linearise about: a few steps, since a fit that converged would have bent
    soil and calibration to whatever the equations miss. Beside a reference that alone tells, since
    what is new would bend them too.
    """
    start = np.zeros(len(stack.rig.constants))
    noise = first_guess(stack, stack.predict(start))
    told = of_reference(noise) if stack.referred else noise

    problem = Problem(stack, told, allowed(stack))
    fitted = problem.descend((), (), start, np.zeros(0), TUNING.fit.rough_rounds)
    return BaseFit(Problem(stack, noise, allowed(stack)), Model(fitted))


def of_reference(noise: Noise) -> Noise:
    """The noise in which the new campaign says nothing."""
    return replace(noise, uncertain=np.where(noise.stack.new, np.inf, noise.uncertain))


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
    return Explainable(np.column_stack([*leading, fitted.raw]), line_columns(stack))


def refit(rough: BaseFit, noise: Noise) -> BaseFit:
    """In the noise that was found, what each run does for itself allowed."""
    problem = in_noise(rough, noise)
    fitted = problem.descend((), (), rough.fitted.u, np.zeros(0))
    return BaseFit(problem, plain_model(problem, fitted), form_terms(problem.stack, noise))


def refit_beside(rough: BaseFit, noise: Noise, more: Sequence[RandomEffect]) -> BaseFit:
    """In the noise that was found, the discrepancy of form and more terms learnt from both
    campaigns together.
    """
    problem = in_noise(rough, noise)
    forms = (*form_terms(problem.stack, noise), *more)
    start = (rough.fitted.u, np.zeros(0))
    model = fit_model(problem, forms, (), (), start, tuple(0 for _ in forms))
    return BaseFit(problem, model, forms)


def sized_beside(
    start: BaseFit, noise: Noise, more: Sequence[RandomEffect], sizes: Chosen
) -> BaseFit:
    """The same with given sizes of all terms."""
    problem = in_noise(start, noise)
    forms = (*form_terms(problem.stack, noise), *more)
    begins = (start.fitted.u, np.zeros(0))
    return BaseFit(problem, sized_model(problem, forms, begins, sizes), forms)


def in_noise(rough: BaseFit, noise: Noise) -> Problem:
    """Without terms, what each run does for itself allowed."""
    stack = rough.problem.stack
    return Problem(stack, noise, np.column_stack((noise.of_runs, allowed(stack))))


def allowed(stack: Stack) -> Array:
    """Columns (N, t) that every fit has: smooth ones, the unrest of the motion, the relief of the
    bed, and what a learnt discrepancy of the configuration leaves open, last.
    """
    share = TUNING.fit.tolerance
    smooth = (tolerance(stack, share), share * of_differences(stack))
    return np.column_stack((*smooth, stack.nuisances, stack.doubts))
