"""A law for what has no name: steps and waves, then few terms of slip, sinkage and speed, fitted
with the soil.

The terms are those of effect `empirical_law`, so that simulator and filter can use what was found.
They are taken up one at a time while their evidence pays for them. Steps and waves belong to this
campaign: where they are is said, and soil and calibration are freed of them, but they are no part
of a configuration.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from gritd.estimator.effects.empirical_law import EmpiricalLaw
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.explain import words_of_place as where
from gritd.tools.diagnose.explain.result import Law, Location, Quantity
from gritd.tools.diagnose.fit.evidence import Signature, log_bayes
from gritd.tools.diagnose.fit.heldout import Held, held_out, run_folds
from gritd.tools.diagnose.fit.problem import WIDE, Fitted, Free, Problem
from gritd.tools.diagnose.fit.signatures import signature
from gritd.tools.diagnose.noise.colour import whiten
from gritd.tools.diagnose.rig.interface import Stack
from gritd.tools.diagnose.rig.wheel import WheelRig
from gritd.tools.diagnose.screen.scans import WAVE, in_step
from gritd.tools.diagnose.search.search import Model, Search
from gritd.tools.diagnose.verdict.decide import functions, remaining

PREFIX = {"torque": "torque", "axle_torque": "torque", "drawbar_pull": "pull", "sinkage": "depth"}
TERMS = {"constant": "1", "slip": "i", "slip_squared": "i²", "sinkage": "z/r", "speed": "ν"}
PAYS = 3.0  # [nats] a term must gain


@dataclass(frozen=True)
class Found:
    """A law on top of a model: its fit, soil and calibration fitted with it, and its held-out
    prediction.
    """

    law: Law
    fitted: Fitted
    held: Held


def find(search: Search, model: Model, location: Sequence[Location]) -> Found | None:
    """The law on top of a model; None where the rig or the channel has none."""
    stack = search.problem.stack
    prefix = next((PREFIX[place.channel] for place in location if place.channel in PREFIX), None)
    if prefix is None or not any(k.soil for k in stack.rig.constants):
        return None
    start = _with_functions(search, model)
    domain, names = _domain(search), [f"{prefix}_{term}" for term in TERMS]
    terms = _terms(search, start, names, domain)
    fitted = _with_terms(start, terms, _edges(domain)) if terms else start.fitted
    if not terms and not start.functions:
        return None
    law = _law(search, model, replace(start, fitted=fitted), prefix, terms, domain)
    return Found(law, fitted, held_out(fitted, run_folds(stack), start.columns))


# ---- steps and waves
# -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Start:
    """A model with the steps and waves beside it that were found; columns (N, m), each one standard
    deviation.
    """

    problem: Problem
    fitted: Fitted
    functions: tuple[Signature, ...]
    columns: Array


def _with_functions(search: Search, model: Model) -> Start:
    problem, found = search.problem, model.fitted
    chosen = [s for s in functions(search, model) if "at" in s.shape]
    if not chosen:
        return Start(problem, found, (), np.zeros((problem.stack.size, 0)))
    chosen = [in_step(search.scans, problem, found, s) for s in chosen]
    columns = WIDE * np.column_stack([s.columns for s in chosen])
    beside = problem.beside(columns)
    return Start(
        beside, beside.descend(found.effects, found.free, found.u, found.x), tuple(chosen), columns
    )


def _said(stack: Stack, start: Start) -> Iterator[tuple[str, str]]:
    """Channel and words of every step and wave, with its size in the channel's unit."""
    taken = start.fitted.slack[len(start.fitted.slack) - start.columns.shape[1] :]
    ends = np.cumsum([0, *(s.columns.shape[1] for s in start.functions)])
    for function, (first, last) in zip(start.functions, pairwise(ends.tolist()), strict=True):
        channel, _, name = function.name.partition("~")
        added = start.columns[:, first:last] @ taken[first:last]
        axis, _, kind = name.partition(" ")
        acting = added[added != 0.0]
        size = float(
            np.sqrt(2.0 * np.mean(acting**2)) if kind == WAVE else acting[np.argmax(np.abs(acting))]
        )
        yield channel, where.term(stack, channel, axis, kind == WAVE, function.shape["at"], size)


# ---- terms ---------------------------------------------------------------------------------------
# ------------------


def _terms(
    search: Search, start: Start, names: list[str], domain: dict[str, tuple[float, float]]
) -> tuple[Free, ...]:
    """Terms of slip, sinkage and speed that pay."""
    fitted, parameters = start.fitted, {p.name: p for p in EmpiricalLaw.parameters()}
    edges = _edges(domain)
    made = signature(
        search.problem.stack, fitted.u, fitted.predicted, EmpiricalLaw, edges, fitted.acting
    )
    if made is None:
        return ()
    strengths = [p.name for p in parameters.values() if p.role == "strength"]
    columns = whiten(search.problem.noise, made.columns[:, [strengths.index(n) for n in names]])
    kept = _forward(fitted, columns)
    return tuple(Free(EmpiricalLaw, parameters[names[i]], EmpiricalLaw.name) for i in kept)


def _forward(fitted: Fitted, columns: Array) -> list[int]:
    """Terms by evidence, until the next no longer pays."""
    a, b = fitted.base().projected(columns)
    kept: list[int] = []
    best = 0.0
    while len(kept) < len(b):
        tried = {i: _value(a, b, [*kept, i]) for i in range(len(b)) if i not in kept}
        i = max(tried, key=lambda k: tried[k])
        if tried[i] < best + PAYS:
            break
        kept, best = [*kept, i], tried[i]
    return kept


def _value(a: Array, b: Array, index: list[int]) -> float:
    return float(log_bayes(a[np.ix_(index, index)], b[index], (0,) * len(index)))


def _with_terms(start: Start, free: tuple[Free, ...], edges: dict[str, float]) -> Fitted:
    """Full fit of the chosen terms; the domain's edges stay."""
    law, found = partial(EmpiricalLaw, **edges), start.fitted
    free = tuple(replace(f, effect=law) for f in free)
    x = np.concatenate((found.x, np.zeros(len(free))))
    return start.problem.descend((*found.effects, law), (*found.free, *free), found.u, x)


def _domain(search: Search) -> dict[str, tuple[float, float]]:
    stack = search.problem.stack
    radius = stack.rig.settings.wheel.radius if isinstance(stack.rig, WheelRig) else 1.0
    ranges = {
        n: np.quantile(stack.covariate(n), (0.005, 0.995)) for n in ("slip", "sinkage", "speed")
    }
    ranges["sinkage"] = ranges["sinkage"] / radius
    return {n: (float(v[0]), float(v[1])) for n, v in ranges.items()}


def _edges(domain: dict[str, tuple[float, float]]) -> dict[str, float]:
    bounds = {p.name: p for p in EmpiricalLaw.parameters()}
    out = {}
    for name, (low, high) in domain.items():
        for key, value in ((f"{name}_from", low), (f"{name}_to", high)):
            out[key] = float(np.clip(value, bounds[key].low, bounds[key].high))
    return out


def _law(
    search: Search, model: Model, start: Start, prefix: str, free: tuple[Free, ...],
    domain: dict[str, tuple[float, float]],
) -> Law:  # fmt: skip
    fitted, stack = start.fitted, search.problem.stack
    channel = {"torque": "torque", "pull": "drawbar_pull", "depth": "sinkage"}[prefix]
    found = _quantities(fitted, len(model.fitted.x), free)
    terms = [f"{q.value:+.3g}·{TERMS[n.partition('_')[2]]}" for n, q in found.items()]
    parts = [f"{channel} {' '.join(terms)}, ν = ln((rω + 1 mm/s)/(21 mm/s))"] if terms else []
    parts += [f"{of} {words}" for of, words in _said(stack, start)]
    gained = 0.5 * (model.fitted.objective - fitted.objective)
    left, _ = remaining(search, Model(fitted, (*model.names, "empirical_law"), 0.0))
    along = {f.name.partition("~")[2].partition(" ")[0] for f in start.functions}
    ranges = {
        n: (float(np.min(x)), float(np.max(x))) for n in sorted(along) for x in [stack.covariate(n)]
    }
    edges = _edged(domain) if found else {}
    return Law(
        channel, "; ".join(parts), {**(domain if found else {}), **ranges},
        gained / max(gained + left, 1e-9), {**found, **edges},
    )  # fmt: skip


def _quantities(fitted: Fitted, before: int, free: tuple[Free, ...]) -> dict[str, Quantity]:
    first = len(fitted.u) + before
    sigma = np.sqrt(np.diag(fitted.covariance()))[first : first + len(free)]
    return {
        f.parameter.name: Quantity(
            f.value(float(x)), float(s) * f.parameter.sigma, f.parameter.unit
        )
        for f, x, s in zip(free, fitted.x[before:], sigma, strict=True)
    }


def _edged(domain: dict[str, tuple[float, float]]) -> dict[str, Quantity]:
    units = {p.name: p.unit for p in EmpiricalLaw.parameters()}
    return {n: Quantity(v, 0.0, units[n]) for n, v in _edges(domain).items()}
