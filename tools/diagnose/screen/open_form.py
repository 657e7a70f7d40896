"""Whether what the rig does anyway explains it: evidence of what is new with the sizes of all
freedoms left open.

With a reference campaign the screen takes the sizes of the discrepancy of form and of the effects
in both campaigns as the reference tells them. A new campaign goes elsewhere, and what stands out of
these sizes may be no more than a rig that is a little less like its model there. So every
candidate is weighed once more: the model of both campaigns without it at the sizes that suit both,
against the model with it at these sizes or smaller ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from gritd.tools.diagnose.fit.evidence import Signature, log_evidence
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.fit.settings import settings_of
from gritd.tools.diagnose.noise.colour import whiten


def gain_with_form_open(problem: Problem, model: Model, signatures: Sequence[Signature]) -> float:
    """The largest log Bayes factor of signatures beside a model [nats], its share among all that
    were tried counted.
    """
    return max(_gains(problem, _suiting(model), signatures), default=0.0)


def _suiting(model: Model) -> Model:
    """The model at the likeliest sizes of its freedoms."""
    marginal = model.marginal
    if marginal is None:
        return model
    smallest = tuple(0 for _ in model.sizes)
    optima = [marginal.likeliest(start) for start in (model.sizes, smallest)]
    sizes = max(optima, key=lambda pair: pair[1])[0]
    return replace(model, sizes=sizes, chosen=sizes)


def _gains(problem: Problem, model: Model, signatures: Sequence[Signature]) -> Iterator[float]:
    settings = settings_of(problem, model)
    for signature in signatures:
        for _, cost, a, b in settings.project(whiten(problem.noise, signature.columns)):
            yield float(log_evidence(a, b, signature.sign)) - cost + signature.prior
