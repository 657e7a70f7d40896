"""From fitted models to a verdict, probabilities and groups.

Probabilities are Bayes weights of all fitted models, softened: evidence is divided by a temperature that grows with
what the best model leaves unexplained, because a model whose form is wrong is overconfident (tempered posterior,
Holmes and Walker 2017, Biometrika 104, 497-503). An effect has the weight of all models that hold it. What no listed
effect explains takes the share UNLISTED gives it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.terramechanics.soil import Array
from tools.diagnose.evidence import Base, log_bayes
from tools.diagnose.result import Verdict
from tools.diagnose.rig import Index
from tools.diagnose.screen import Screen, whitened
from tools.diagnose.select import Model, Search, form, rescreen

TEMPERATURE = 2.0  # of evidence where nothing remains
LEFTOVER = 0.15  # further temperature per nat left unexplained
ALIKE = 4.0  # [nats] effects whose evidence differs less, temperature taken off, cannot be told apart
LISTED = 5.0  # [nats] head start of the library over functions without a name
SHAPE = 0.08  # and this share of its evidence, since a form's details may differ
PAIR = 3.0  # [nats] a second function must gain
SIZES = (1.0, 5.0)  # of a function, in its expected size, where it is fitted
FAMILIES, LEFT = 2, 4  # functions without a name that may act together; that count what is left
TAKEN, ABOUT = 0.9, 0.04  # share of the explainable misfit a listed explanation must take
POWER = 0.4  # share of the effects that must be detectable at their expected size for "consistent"


@dataclass(frozen=True)
class Decision:
    verdict: Verdict
    best: Model
    share: float  # of the explainable misfit that the best model takes
    left: float  # nats that smooth functions could still gain
    left_significant: bool
    probability: dict[str, float]
    unlisted: float
    groups: dict[str, tuple[str, ...]]


def decide(search: Search) -> Decision:
    base, found = search.models[0], search.screens[()]
    if not found.alarmed:
        verdict: Verdict = "consistent" if power(search, found) >= POWER else "insufficient"
        return Decision(verdict, base, 1.0, 0.0, False, _quiet(found), 0.0, {})
    best, share, left, significant = _explanation(search)
    temperature = TEMPERATURE + LEFTOVER * left
    gained = best.evidence - base.evidence
    ahead = refitted(search, base) - gained - LISTED - SHAPE * max(gained, 0.0)
    unlisted = max(_unlisted(share, significant, bool(best.names)), float(1.0 / (1.0 + np.exp(-ahead / TEMPERATURE))))
    listed = bool(best.names) and unlisted < 0.5
    probability = {n: p * (1.0 - unlisted) for n, p in probabilities(search.models, temperature).items()}
    return Decision(
        "explained" if listed else "unlisted",
        best, share, left, significant, probability, unlisted, groups(search, best, temperature),
    )  # fmt: skip


def _explanation(search: Search) -> tuple[Model, float, float, bool]:
    """The fewest effects that take (nearly) all, else the most probable model."""
    base = search.models[0]
    best = search.best()
    left, significant = remaining(search, best)
    gained = 0.5 * (base.fitted.objective - best.fitted.objective)
    return best, gained / max(gained + left, 1e-9), left, significant


def remaining(search: Search, model: Model) -> tuple[float, bool]:
    """Nats that smooth functions of the covariates would still gain; whether any of them stands out of the noise."""
    found = search.screens.get(model.names) or rescreen(search, model)
    standing = [e for n, e in found.evidence.items() if "~" in n and e > found.threshold]
    return (nameless(search, model, LEFT) if standing else 0.0), bool(standing)


def nameless(search: Search, model: Model, most: int) -> float:
    """Evidence for the best few smooth functions of covariates on top of a model, taken up in turn [nats]."""
    return _families(search, model, most)[0]


def refitted(search: Search, model: Model) -> float:
    """The same with soil and calibration fitted anew beside the best functions, as listed effects are fitted [nats]."""
    linear, chosen = _families(search, model, FAMILIES)
    if not chosen:
        return linear
    problem, found = search.problem, model.fitted
    columns = np.column_stack([search.generics[i].columns for i in chosen])
    gains = [linear]
    for scale in SIZES:
        fitted = problem.beside(columns * scale).descend(found.effects, found.free, found.u, found.x)
        gain = fitted.log_evidence - found.log_evidence
        gains.append(gain - (PAIR + form(gain)) * (len(chosen) - 1))
    return max(gains)


def _families(search: Search, model: Model, most: int) -> tuple[float, list[int]]:
    """Evidence of the chosen functions together [nats], and their places among the generics."""
    base = model.fitted.base()
    ready = whitened(search.problem.noise, search.generics)
    a, b = base.projected(np.column_stack([w.columns for w in ready]))
    ends = np.cumsum([w.columns.shape[1] for w in ready])
    parts = [np.arange(end - w.columns.shape[1], end) for w, end in zip(ready, ends, strict=True)]
    total = 0.0
    chosen: list[int] = []
    for _ in range(most):
        tried = [_together(a, b, [parts[i] for i in (*chosen, k)]) for k in range(len(parts))]
        best = int(np.argmax(tried))
        price = PAIR + form(total) if chosen else 0.0
        if best in chosen or tried[best] - price <= total:
            break
        total, chosen = tried[best] - price, [*chosen, best]
    return total, chosen


def _together(a: Array, b: Array, parts: list[Index]) -> float:
    index = np.unique(np.concatenate(parts))
    return float(log_bayes(a[np.ix_(index, index)], b[index], (0,) * len(index)))


def _unlisted(share: float, significant: bool, any_effect: bool) -> float:
    """Probability that the physics is not in the library."""
    if not any_effect:
        return 0.95
    if not significant:
        return 0.02
    return float(1.0 / (1.0 + np.exp((share - TAKEN) / ABOUT)))


def probabilities(models: Sequence[Model], temperature: float) -> dict[str, float]:
    """Weight of all models that hold an effect."""
    evidence = np.array([m.evidence for m in models]) / temperature
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    out: dict[str, float] = {}
    for model, w in zip(models, weight, strict=True):
        for name in model.names:
            out[name] = out.get(name, 0.0) + float(w)
    return out


def _quiet(found: Screen) -> dict[str, float]:
    """Probabilities where nothing alarms: what the screen itself leaves to each effect."""
    listed = {n: e for n, e in found.evidence.items() if "~" not in n}
    weight = {n: float(np.exp(min(e, 20.0) / TEMPERATURE)) / max(len(listed), 1) for n, e in listed.items()}
    total = 20.0 + sum(weight.values())
    return {n: w / total for n, w in weight.items()}


def groups(search: Search, best: Model, temperature: float) -> dict[str, tuple[str, ...]]:
    """For each effect of the best model, those that could stand in its place."""
    out: dict[str, tuple[str, ...]] = {}
    for name in best.names:
        rest = set(best.names) - {name}
        rivals = [
            m for m in search.models
            if len(m.names) == len(best.names) and rest <= set(m.names) and m is not best
            and best.evidence - m.evidence < ALIKE * temperature / TEMPERATURE
        ]  # fmt: skip
        rivals.sort(key=lambda m: -m.evidence)
        out[name] = tuple(dict.fromkeys(n for m in rivals for n in m.names if n not in rest))
    return out


def power(search: Search, found: Screen) -> float:
    """Share of the listed effects that would be seen at their expected size."""
    base: Base = search.models[0].fitted.base()
    seen = []
    for name, ready in found.best.items():
        if "~" not in name:
            a, _ = base.projected(ready.columns)
            gain = 0.5 * np.trace(a) - 0.5 * np.log1p(np.maximum(np.diag(a), 0.0)).sum()
            seen.append(gain > found.threshold)
    return float(np.mean(seen)) if seen else 0.0
