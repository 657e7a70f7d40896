"""The base model of two campaigns: what a reference shows is this rig, and nothing new.

The reference has three things of its own that no explanation is asked for: a discrepancy of form,
the library's effects in both campaigns (shared.py), and noise. Noise is what the reference leaves
beside the other two as they were *fitted*: what their priors do not let them follow counts as
noise.

All three are learnt from the reference alone: of what the new campaign alone shows nothing is
known. A size that the new campaign may raise takes what is new for what is usual: some effects of
both campaigns that cancel where the reference drove are never amiss in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.base import BaseFit, of_reference, refit_beside, sized_beside
from gritd.tools.diagnose.fit.discrepancy import form_terms
from gritd.tools.diagnose.fit.shared import (
    lasting,
    rippling_columns,
    shared_columns,
    shared_terms,
    without_ripples,
)
from gritd.tools.diagnose.noise.colour import Noise
from gritd.tools.diagnose.noise.estimate import estimate_of_reference, louder, restless
from gritd.tools.diagnose.noise.saturated import Explainable


def fit_beside_reference(rough: BaseFit) -> BaseFit:
    """From a rough fit of the reference: first in the least noise that the reference may have,
    then in what the fit left of it.
    """
    stack = rough.problem.stack
    shared = shared_columns(stack, rough.fitted.u, rough.fitted.predicted)
    ripples = rippling_columns(stack)
    noise = _least_noise(rough, shared, ripples)
    first = _of_reference(rough, noise, shared, ripples)

    none = np.zeros((stack.size, 0))
    predicted, over = first.fitted.predicted, left(first)
    calm = without_ripples(stack, over, ripples)
    alone = estimate_of_reference(stack, predicted, over, calm, Explainable(none, none), noise)
    noise = restless(louder(noise, alone), calm)

    usual = _of_reference(first, noise, shared, ripples)
    shown, sizes = {f.name for f in usual.forms}, usual.model.sizes
    more = [f for f in shared_terms(noise, shared, ripples) if f.name in shown]
    base = sized_beside(usual, noise, lasting(more, sizes[len(sizes) - len(more) :]), sizes)
    return replace(base, usual=usual.fitted.u)


def _of_reference(
    start: BaseFit, noise: Noise, shared: Mapping[str, Array], ripples: Array
) -> BaseFit:
    """The reference alone, fitted with all its terms: the new campaign says nothing."""
    alone = of_reference(noise)
    return refit_beside(start, alone, shared_terms(alone, shared, ripples))


def left(base: BaseFit) -> Array:
    """What a fit leaves (N,), its terms counted, in the channels' units."""
    fitted = base.fitted
    carried = fitted.nuisance.carried
    terms = carried.times(fitted.slack[fitted.slack.size - carried.count :])
    return np.asarray(base.problem.stack.measured - fitted.predicted - terms)


def _least_noise(rough: BaseFit, shared: Mapping[str, Array], ripples: Array) -> Noise:
    """What no function of the form, no effect and no constant could explain of the reference."""
    stack, before = rough.problem.stack, rough.problem.noise
    forms = [f.columns.dense for f in form_terms(stack, before)]
    whole = np.column_stack([ripples, *forms])
    leading = np.column_stack((rough.fitted.raw, *shared.values()))
    predicted = rough.fitted.predicted
    residual = stack.measured - predicted
    calm = without_ripples(stack, residual, ripples)
    return estimate_of_reference(
        stack, predicted, residual, calm, Explainable(leading, whole), before
    )
