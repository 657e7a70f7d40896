"""A law for what has no name: steps and waves, then few terms of slip, sinkage and speed, fitted
with the soil.

The terms are those of effect `empirical_law`, so that simulator and filter can use what was found.
They are taken up one at a time while their evidence pays for them. Steps and waves belong to this
campaign: where they are is said, and soil and calibration are freed of them, but they are no part
of a configuration.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from gritd.estimator.effects.base import Effect
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.explain import wording
from gritd.tools.diagnose.explain.result import Law, Location, Quantity
from gritd.tools.diagnose.fit.evidence import Signature
from gritd.tools.diagnose.fit.heldout import HeldOut, held_out, run_folds
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Fitted, Free, Maker, Problem
from gritd.tools.diagnose.fit.selection import parts_of, take_up
from gritd.tools.diagnose.fit.signatures import signature
from gritd.tools.diagnose.rig.interface import LawForm
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.screen.screening import Screening
from gritd.tools.diagnose.search.search import EffectSearch
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.verdict.decide import taken_share
from gritd.tools.diagnose.verdict.unexplained import unexplained_functions

Domain = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class FittedLaw:
    """A law on top of a model. held: its prediction of runs that are held out; plain: its fit, with
    soil and calibration, without steps and waves, which are no part of a configuration.
    """

    law: Law
    held: HeldOut
    plain: Fitted
    plain_held: HeldOut


@dataclass(frozen=True)
class Start:
    """A model with the steps and waves beside it that were found; columns (N, m), each one standard
    deviation.
    """

    problem: Problem
    fitted: Fitted
    functions: tuple[Signature, ...]
    columns: Array

    @property
    def taken(self) -> Array:
        """How much of each column was fitted."""
        slack = self.fitted.slack
        return slack[slack.size - self.columns.shape[1] :]


def find_law(search: EffectSearch, model: Model, location: Sequence[Location]) -> FittedLaw | None:
    """The law on top of a model; None where the rig or the channel has none."""
    stack = search.problem.stack
    form = stack.rig.words.law
    if form is None:
        return None
    prefix = next((form.prefix[p.channel] for p in location if p.channel in form.prefix), None)
    if prefix is None:
        return None

    start = _with_functions(search.screening, model)
    domain, names = _domain(stack, form), [f"{prefix}_{term}" for term in form.terms]
    terms = _terms(start, form, names, domain)
    if not terms and not start.functions:
        return None
    if terms:
        start = replace(start, fitted=_with_terms(start, terms, form, domain))

    law = _law(search, model, start, prefix, terms, domain)
    plain, folds = start.fitted, run_folds(stack)
    if start.functions:
        alone = Start(search.problem, model.fitted, (), start.columns[:, :0])
        plain = _with_terms(alone, terms, form, domain) if terms else model.fitted
    return FittedLaw(law, held_out(start.fitted, folds), plain, held_out(plain, folds))


# ---- steps and waves ---------------------------------------------------------------------------


def _with_functions(screening: Screening, model: Model) -> Start:
    problem, fitted = screening.problem, model.fitted
    chosen = [s for s in unexplained_functions(screening, model) if s.shape.kind != "smooth"]
    if not chosen:
        return Start(problem, fitted, (), np.zeros((problem.stack.size, 0)))

    columns = TUNING.fit.strength_prior * np.column_stack([s.columns for s in chosen])
    beside = problem.beside(columns)
    refitted = beside.descend(fitted.effects, fitted.free, fitted.u, fitted.x)
    return Start(beside, refitted, tuple(chosen), columns)


def _words(stack: Stack, start: Start) -> Iterator[str]:
    """Every step and wave, with its size in the channel's unit."""
    ends = np.cumsum([0, *(s.columns.shape[1] for s in start.functions)])

    for function, (first, last) in zip(start.functions, pairwise(ends.tolist()), strict=True):
        added = start.columns[:, first:last] @ start.taken[first:last]
        acting = added[added != 0.0]
        if function.shape.kind == "wave":
            size = float(np.sqrt(2.0 * np.mean(acting**2)))
        else:
            size = float(acting[np.argmax(np.abs(acting))])

        yield f"{function.shape.channel} {wording.term(stack, function.shape, size)}"


# ---- terms -------------------------------------------------------------------------------------


def _terms(start: Start, form: LawForm, names: list[str], domain: Domain) -> tuple[Free, ...]:
    """Terms of slip, sinkage and speed that pay."""
    fitted, parameters = start.fitted, {p.name: p for p in form.effect.parameters()}
    edges = _edges(form.effect, domain)
    made = signature(
        start.problem.stack, fitted.u, fitted.predicted, form.effect, edges, fitted.acting
    )
    if made is None:
        return ()

    strengths = [p.name for p in parameters.values() if p.role == "strength"]
    each = [
        replace(made, columns=made.columns[:, [strengths.index(name)]], prior=-np.log(len(names)))
        for name in names
    ]
    parts = parts_of(fitted.projection(), start.problem.noise, each)
    kept = take_up(parts, range(len(each)), len(each), share=TUNING.explain.least_share).parts
    return tuple(Free(form.effect, parameters[names[i]], form.effect.name) for i in kept)


def _with_terms(start: Start, free: tuple[Free, ...], form: LawForm, domain: Domain) -> Fitted:
    """Full fit of the chosen terms; the domain's edges stay."""
    effect, fitted = partial(form.effect, **_edges(form.effect, domain)), start.fitted
    free = tuple(replace(f, effect=effect) for f in free)
    x = np.concatenate((fitted.x, np.zeros(len(free))))
    effects: tuple[Maker, ...] = (*fitted.effects, effect)
    return start.problem.descend(effects, (*fitted.free, *free), fitted.u, x)


def _domain(stack: Stack, form: LawForm) -> Domain:
    """Of each covariate the range that was driven, in the effect's units."""
    beyond = TUNING.explain.learnt_beyond
    ranges = {
        n: np.quantile(stack.covariate(n), (beyond, 1.0 - beyond)) / unit
        for n, unit in form.domain.items()
    }
    return {n: (float(v[0]), float(v[1])) for n, v in ranges.items()}


def _edges(effect: type[Effect], domain: Domain) -> dict[str, float]:
    bounds = {p.name: p for p in effect.parameters()}
    out = {}
    for name, (low, high) in domain.items():
        for key, value in ((f"{name}_from", low), (f"{name}_to", high)):
            out[key] = float(np.clip(value, bounds[key].low, bounds[key].high))
    return out


# ---- in words ----------------------------------------------------------------------------------


def _law(
    search: EffectSearch,
    model: Model,
    start: Start,
    prefix: str,
    free: tuple[Free, ...],
    domain: Domain,
) -> Law:
    fitted, stack = start.fitted, search.problem.stack
    form = stack.rig.words.law
    assert form is not None
    channel, quantities = form.channel[prefix], _quantities(fitted, len(model.fitted.x), free)
    terms = [
        f"{q.value:+.3g}·{form.terms[n.removeprefix(prefix + '_')]}" for n, q in quantities.items()
    ]
    parts = [f"{channel} {' '.join(terms)}, {form.note}"] if terms else []
    parts += _words(stack, start)

    along = sorted({f.shape.along[0] for f in start.functions})
    covariates = {n: stack.covariate(n) for n in along}
    ranges = {n: (float(np.min(x)), float(np.max(x))) for n, x in covariates.items()}
    edges = _stated_edges(form.effect, domain) if quantities else {}
    return Law(
        channel,
        "; ".join(parts),
        {**(domain if quantities else {}), **ranges},
        taken_share(search, Model(fitted), start.columns @ start.taken),
        {**quantities, **edges},
    )


def _quantities(fitted: Fitted, before: int, free: tuple[Free, ...]) -> dict[str, Quantity]:
    first = len(fitted.u) + before
    sigma = fitted.sigma[first : first + len(free)]
    return {
        f.parameter.name: Quantity(
            f.value(float(x)), float(s) * f.parameter.sigma, f.parameter.unit
        )
        for f, x, s in zip(free, fitted.x[before:], sigma, strict=True)
    }


def _stated_edges(effect: type[Effect], domain: Domain) -> dict[str, Quantity]:
    units = {p.name: p.unit for p in effect.parameters()}
    return {n: Quantity(v, 0.0, units[n]) for n, v in _edges(effect, domain).items()}
