"""From fitted models to a verdict, probabilities and groups.

Every explanation has an evidence: listed effects, with a discrepancy for forms other than ours
    (discrepancy.py);
or smooth functions without a name instead of them: `unlisted`. `calibration.py` makes probabilities
of these. An effect has the weight of all models that hold it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.explain.result import Verdict
from gritd.tools.diagnose.fit.evidence import Base, Signature, log_bayes
from gritd.tools.diagnose.rig.interface import Index
from gritd.tools.diagnose.screen import scans
from gritd.tools.diagnose.screen.screen import Screen, whitened
from gritd.tools.diagnose.search.search import Model, Search, rescreen
from gritd.tools.diagnose.verdict import forms as discrepancy
from gritd.tools.diagnose.verdict.calibration import Calibration, learnt

ALIKE = 2.0  # log odds: effects that are less apart cannot be told apart
PAIR = 3.0  # [nats] a second function must gain
FORM, FORM_MOST = 0.08, 25.0  # and this share of what the first gained, at most so many nats
SIZES = (1.0, 5.0)  # of a function, in its expected size, where it is fitted
FAMILIES, FITTED = (
    4,
    2,
)  # functions without a name that may act together; that are fitted with the soil
WEIGHED = 5  # models at most, of one effect and of more
NEAR, FAR = 0.5, 60.0  # within this share of the best gain, or so many nats of it
WHOLE, MUCH = 0.9, 20.0  # share of the misfit that an explanation takes, if it leaves so many nats
# belief in one that takes less: of eleven such in simulated cases none was right, of eight others
# all
PART = 0.1
POWER = 0.4  # share of the effects that must be detectable at their expected size for "consistent"
QUIET = 2.0  # temperature of the screen's evidence where nothing alarms


@dataclass(frozen=True)
class Weighed:
    """A model and its log evidence above the base model's for each degree of difference
    (discrepancy.FORMS,).
    """

    model: Model
    evidence: Array


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
    weighed: tuple[Weighed, ...] = ()
    nameless: float = -np.inf  # evidence of functions without a name [nats above the base model]


def decide(search: Search) -> Decision:
    base, found = search.models[0], search.screens[()]
    if not found.alarmed:
        verdict: Verdict = "consistent" if power(search, found) >= POWER else "insufficient"
        return Decision(verdict, base, 1.0, 0.0, False, _quiet(found), 0.0, {})
    return judged(search, weigh(search), nameless_evidence(search, base), learnt())


def judged(
    search: Search, weighed: Sequence[Weighed], nameless: float, calibration: Calibration
) -> Decision:
    """The decision from the evidence of all explanations [nats above the base model]."""
    weights = np.array([calibration.listed(w.evidence, len(w.model.names)) for w in weighed])
    unnamed = calibration.unlisted(nameless)
    total = float(np.logaddexp(logsumexp(weights), unnamed)) if weighed else unnamed
    best = _best(weighed, weights) if weighed else search.models[0]
    left, significant = remaining(search, best)
    gained = 0.5 * (search.models[0].fitted.objective - best.fitted.objective)
    share = gained / max(gained + left, 1e-9)
    beyond = left - max((_bending(w) for w in weighed if w.model is best), default=0.0)
    believed = (PART if significant and beyond > MUCH and share < WHOLE else 1.0) * (
        1.0 - calibration.lapse
    )
    unlisted = 1.0 - calibration.lapse - believed * -float(np.expm1(unnamed - total))
    return Decision(
        "explained" if weighed and unlisted < 0.5 * (1.0 - calibration.lapse) else "unlisted",
        best, share, left, significant, _probabilities(weighed, weights - total + np.log(believed)), unlisted,
        _groups(weighed, weights, best), tuple(weighed), nameless,
    )  # fmt: skip


def _bending(weighed: Weighed) -> float:
    """Nats that another published form of the same effects takes of what they leave."""
    return float(weighed.evidence.max() - weighed.evidence[0])


def _best(weighed: Sequence[Weighed], weights: Array) -> Model:
    """The likeliest model of the likeliest number of effects: many alike sets of two weigh together
    against one.
    """
    sizes = np.array([len(w.model.names) for w in weighed])
    size = max(np.unique(sizes).tolist(), key=lambda n: float(logsumexp(weights[sizes == n])))
    return weighed[int(np.argmax(np.where(sizes == size, weights, -np.inf)))].model


def weigh(search: Search) -> list[Weighed]:
    """The models that may count, the most evident first."""
    base = search.models[0]
    gains = {
        id(m): m.fitted.log_evidence - base.fitted.log_evidence for m in search.models if m.names
    }
    if not gains:
        return []
    top = max(gains.values())
    near = [m for m in search.models if m.names and gains[id(m)] > top - max(NEAR * top, FAR)]
    near.sort(key=lambda m: -gains[id(m)])
    one, more = (
        [m for m in near if (len(m.names) == 1) == single][:WEIGHED] for single in (True, False)
    )
    return [
        Weighed(m, discrepancy.evidence(search.problem, m.fitted, base.fitted))
        for m in (*one, *more)
    ]


def remaining(search: Search, model: Model) -> tuple[float, bool]:
    """Nats that smooth functions of the covariates would still gain; whether any of them stands out
    of the noise.
    """
    found = search.screens.get(model.names) or rescreen(search, model)
    standing = [n for n in found.stands_out if "~" in n] if found.alarmed else []
    return (_families(search, model, FAMILIES)[0] if standing else 0.0), bool(standing)


def nameless_evidence(search: Search, model: Model) -> float:
    """Evidence for functions without a name on top of a model [nats], as far as they may act
    together.

    Linear, and with soil and calibration fitted anew beside the first few, as they are for listed
    effects.
    """
    linear, chosen = _families(search, model, FAMILIES)
    return max(
        [
            linear,
            *(_refitted(search, model, chosen[: n + 1]) for n in range(min(len(chosen), FITTED))),
        ]
    )


def functions(search: Search, model: Model) -> list[Signature]:
    """Functions without a name that act together beside a model."""
    return _families(search, model, FAMILIES)[1]


def _refitted(search: Search, model: Model, chosen: Sequence[Signature]) -> float:
    problem, found = search.problem, model.fitted
    columns, prior = np.column_stack([s.columns for s in chosen]), sum(s.prior for s in chosen)
    gains = []
    for scale in SIZES:
        fitted = problem.beside(columns * scale).descend(
            found.effects, found.free, found.u, found.x
        )
        gain = fitted.log_evidence - found.log_evidence + prior
        gains.append(gain - (PAIR + _form(gain)) * (len(chosen) - 1))
    return max(gains)


def _families(search: Search, model: Model, most: int) -> tuple[float, list[Signature]]:
    """Evidence of the chosen functions together [nats], and which they are."""
    base = scans.without_harmonics(search.problem, model.fitted)
    functions = [*search.generics, *scans.candidates(search.scans, search.problem, model.fitted)]
    prior = np.array([s.prior for s in functions])
    ready = whitened(search.problem.noise, functions)
    a, b = base.projected(np.column_stack([w.columns for w in ready]))
    ends = np.cumsum([w.columns.shape[1] for w in ready])
    parts = [np.arange(end - w.columns.shape[1], end) for w, end in zip(ready, ends, strict=True)]
    total = 0.0
    chosen: list[int] = []
    for _ in range(most):
        tried = [
            _together(a, b, [parts[i] for i in (*chosen, k)]) + float(prior[[*chosen, k]].sum())
            for k in range(len(parts))
        ]
        best = int(np.argmax(tried))
        price = PAIR + _form(total) if chosen else 0.0
        if best in chosen or tried[best] - price <= total:
            break
        total, chosen = tried[best] - price, [*chosen, best]
    return total, [functions[i] for i in chosen]


def _together(a: Array, b: Array, parts: list[Index]) -> float:
    index = np.unique(np.concatenate(parts))
    return float(log_bayes(a[np.ix_(index, index)], b[index], (0,) * len(index)))


def _form(gained: float) -> float:
    return float(np.clip(FORM * gained, 0.0, FORM_MOST))


def _probabilities(weighed: Sequence[Weighed], log_share: Array) -> dict[str, float]:
    """Weight of all models that hold an effect."""
    out: dict[str, float] = {}
    for w, share in zip(weighed, np.exp(log_share).tolist(), strict=True):
        for name in w.model.names:
            out[name] = out.get(name, 0.0) + share
    return out


def _quiet(found: Screen) -> dict[str, float]:
    """Probabilities where nothing alarms: what the screen itself leaves to each effect."""
    listed = {n: e for n, e in found.evidence.items() if "~" not in n}
    weight = {
        n: float(np.exp(min(e, 20.0) / QUIET)) / max(len(listed), 1) for n, e in listed.items()
    }
    total = 20.0 + sum(weight.values())
    return {n: w / total for n, w in weight.items()}


def _groups(weighed: Sequence[Weighed], weights: Array, best: Model) -> dict[str, tuple[str, ...]]:
    """For each effect of the best model, those that could stand in its place."""
    out: dict[str, tuple[str, ...]] = {}
    order = np.argsort(-weights)
    top = max(
        (w for m, w in zip(weighed, weights.tolist(), strict=True) if m.model is best), default=0.0
    )
    for name in best.names:
        rest = set(best.names) - {name}
        rivals = [
            weighed[i].model for i in order
            if len(weighed[i].model.names) == len(best.names) and rest <= set(weighed[i].model.names)
            and weighed[i].model is not best and top - weights[i] < ALIKE
        ]  # fmt: skip
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
            seen.append(found.surprise(name, float(gain)) > found.threshold)
    return float(np.mean(seen)) if seen else 0.0
