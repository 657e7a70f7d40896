"""A law for what has no name: few terms of slip, sinkage and speed, fitted with the soil.

The terms are those of effect `empirical_law`, so that simulator and filter can use what was found.
They are taken up one at a time while their evidence pays for them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from gritd.tools.cli.wording import spelled
from gritd.tools.diagnose.explain.result import Law, Location, Quantity, SoilFit
from gritd.tools.diagnose.explain.soil import constants_of
from gritd.tools.diagnose.explain.wording import signed
from gritd.tools.diagnose.fit.heldout import HeldOut, held_out, run_folds
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Fitted, Free, free_of
from gritd.tools.diagnose.fit.selection import parts_of, take_up
from gritd.tools.diagnose.fit.signatures import signature
from gritd.tools.diagnose.rig.interface import LawForm
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.search.models import EffectSearch
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.verdict.decide import taken_share


def find_law(
    search: EffectSearch, location: Sequence[Location], soil: SoilFit | None, form: HeldOut
) -> Law | None:
    """The law on top of the exact model that carries the misfit, for the first channel of some
    places that has one: it takes nearly all, and predicts runs that were held out better than the
    discrepancy of form does. Its soil is no better known than that of all explanations.
    """
    stack, base = search.problem.stack, search.base.fitted
    words = stack.rig.words.law
    if words is None or soil is None:
        return None
    prefix = next((words.prefix[p.channel] for p in location if p.channel in words.prefix), None)
    if prefix is None:
        return None

    edges = _edges(stack, words)
    free = _terms(search, words, prefix, edges)
    if not free:
        return None

    fitted = search.problem.descend((free[0].effect,), free, base.u, np.zeros(len(free)))
    share = taken_share(search, Model(fitted))
    held = held_out(fitted, run_folds(stack))
    better = float((held.log_density - form.log_density).sum()) > 0.0
    if not better or share < 1.0 - TUNING.explain.law_leaves:
        return None

    beside = constants_of(stack.rig, fitted, soil=True)
    known = {n: replace(q, sigma=max(q.sigma, soil.after[n].sigma)) for n, q in beside.items()}
    return replace(_law(words, fitted, prefix, edges), share=share, soil=known)


def _edges(stack: Stack, form: LawForm) -> dict[str, float]:
    """The range of each covariate that was driven, as parameters of the effect."""
    beyond = TUNING.explain.learnt_beyond
    bounds, edges = {p.name: p for p in form.effect.parameters()}, {}

    for name, unit in form.domain.items():
        ends = np.quantile(stack.covariate(name), (beyond, 1.0 - beyond)) / unit
        for key, value in zip((f"{name}_from", f"{name}_to"), ends, strict=True):
            edges[key] = float(np.clip(value, bounds[key].low, bounds[key].high))
    return edges


def _terms(
    search: EffectSearch, form: LawForm, prefix: str, edges: Mapping[str, float]
) -> tuple[Free, ...]:
    """Terms of slip, sinkage and speed that pay."""
    fitted, stack = search.base.fitted, search.problem.stack
    made = signature(stack, fitted.u, fitted.predicted, form.effect, edges, fitted.acting)
    if made is None:
        return ()

    strengths = [f for f in free_of((form.effect,)) if f.parameter.role == "strength"]
    own = {f"{prefix}_{term}" for term in form.terms}
    free = [(k, f) for k, f in enumerate(strengths) if f.parameter.name in own]
    each = [replace(made, columns=made.columns[:, [k]], prior=-np.log(len(own))) for k, _ in free]
    parts = parts_of(fitted.projection(), search.problem.noise, each)
    kept = take_up(parts, range(len(each)), len(each), share=TUNING.explain.least_share).parts

    effect = partial(form.effect, **edges)
    return tuple(replace(free[k][1], effect=effect) for k in kept)


def _law(form: LawForm, fitted: Fitted, prefix: str, edges: Mapping[str, float]) -> Law:
    sigma = fitted.sigma[len(fitted.u) :]
    found = {
        f.parameter.name: Quantity(f.value(x), s * f.parameter.sigma, f.parameter.unit)
        for f, x, s in zip(fitted.free, fitted.x.tolist(), sigma.tolist(), strict=False)
    }

    units = {p.name: p.unit for p in form.effect.parameters()}
    terms = [
        f"{signed(q.value, q.unit)}·{form.terms[name.removeprefix(f'{prefix}_')]}"
        for name, q in found.items()
    ]
    notes = [form.note] if any(term.endswith(form.note[0]) for term in terms) else []
    channel = form.channel[prefix]
    return Law(
        channel,
        ", ".join([f"{spelled(channel)} {' '.join(terms)}", *notes]),
        {name: (edges[f"{name}_from"], edges[f"{name}_to"]) for name in form.domain},
        1.0,
        {**found, **{name: Quantity(value, 0.0, units[name]) for name, value in edges.items()}},
    )
