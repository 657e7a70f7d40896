"""A law for what has no name: few terms of slip, sinkage and speed, fitted with the soil, in one channel.

The terms are those of effect `empirical_law`, so that simulator and filter can use what was found. They are taken up
one at a time while their evidence pays for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from estimator.effects.empirical_law import EmpiricalLaw
from estimator.terramechanics.soil import Array
from tools.diagnose.decide import remaining
from tools.diagnose.evidence import log_bayes
from tools.diagnose.fit import Fitted, Free
from tools.diagnose.heldout import Held, held_out, run_folds
from tools.diagnose.noise import whiten
from tools.diagnose.result import Law, Location, Quantity
from tools.diagnose.select import Model, Search
from tools.diagnose.signatures import signature
from tools.diagnose.wheel_rig import WheelRig

PREFIX = {"torque": "torque", "axle_torque": "torque", "drawbar_pull": "pull", "sinkage": "depth"}
TERMS = {"constant": "1", "slip": "i", "slip_squared": "i²", "sinkage": "z/r", "speed": "ν"}
PAYS = 3.0  # [nats] a term must gain


def find(search: Search, model: Model, location: Sequence[Location]) -> tuple[Law | None, Held | None]:
    """The law on top of a model, and its held-out prediction; None where the rig or the channel has none."""
    stack = search.problem.stack
    prefix = next((PREFIX[place.channel] for place in location if place.channel in PREFIX), None)
    if prefix is None or not any(k.soil for k in stack.rig.constants):
        return None, None
    parameters = {p.name: p for p in EmpiricalLaw.parameters()}
    names = [f"{prefix}_{term}" for term in TERMS]
    domain = _domain(search)
    made = signature(stack, model.fitted.u, model.fitted.predicted, EmpiricalLaw, _edges(domain), model.fitted.acting)
    if made is None:
        return None, None
    strengths = [p.name for p in parameters.values() if p.role == "strength"]
    columns = whiten(search.problem.noise, made.columns[:, [strengths.index(n) for n in names]])
    kept = _forward(model.fitted, columns)
    if not kept:
        return None, None
    free = tuple(Free(EmpiricalLaw, parameters[names[i]], EmpiricalLaw.name) for i in kept)
    fitted = _with_terms(search, model, free, _edges(domain))
    return _law(search, model, fitted, prefix, [names[i] for i in kept], free, domain), held_out(
        fitted, run_folds(stack)
    )


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


def _with_terms(search: Search, model: Model, free: tuple[Free, ...], edges: dict[str, float]) -> Fitted:
    """Full fit of the chosen terms; the domain's edges stay."""
    law = partial(EmpiricalLaw, **edges)
    free = tuple(replace(f, effect=law) for f in free)
    x = np.concatenate((model.fitted.x, np.zeros(len(free))))
    return search.problem.descend((*model.fitted.effects, law), (*model.fitted.free, *free), model.fitted.u, x)


def _domain(search: Search) -> dict[str, tuple[float, float]]:
    stack = search.problem.stack
    radius = stack.rig.settings.wheel.radius if isinstance(stack.rig, WheelRig) else 1.0
    ranges = {n: np.quantile(stack.covariate(n), (0.005, 0.995)) for n in ("slip", "sinkage", "speed")}
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
    search: Search, model: Model, fitted: Fitted, prefix: str, names: list[str], free: tuple[Free, ...],
    domain: dict[str, tuple[float, float]],
) -> Law:  # fmt: skip
    sigma = np.sqrt(np.diag(fitted.covariance()))[len(fitted.u) + len(model.fitted.x) :]
    values = fitted.x[len(model.fitted.x) :]
    found = {
        n: Quantity(f.value(float(x)), float(s) * f.parameter.sigma, f.parameter.unit)
        for n, f, x, s in zip(names, free, values, sigma, strict=False)
    }
    terms = [f"{q.value:+.3g}·{TERMS[n.partition('_')[2]]}" for n, q in found.items()]
    channel = {"torque": "torque", "pull": "drawbar_pull", "depth": "sinkage"}[prefix]
    gained = 0.5 * (model.fitted.objective - fitted.objective)
    left, _ = remaining(search, Model(fitted, (*model.names, "empirical_law"), 0.0))
    units = {p.name: p.unit for p in EmpiricalLaw.parameters()}
    edges = {n: Quantity(v, 0.0, units[n]) for n, v in _edges(domain).items()}
    expression = f"{channel} {' '.join(terms)}, ν = ln((rω + 1 mm/s)/(21 mm/s))"
    return Law(channel, expression, domain, gained / max(gained + left, 1e-9), {**found, **edges})
