"""From fitted models to a verdict, probabilities and groups.

Every explanation has an evidence: listed effects, with a discrepancy for forms other than ours
(forms.py); or functions without a name instead of them: `unlisted` (nameless.py). `calibration.py`
makes probabilities of these. An effect has the weight of all models that hold it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import logsumexp

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.screen.screen import Screen
from gritd.tools.diagnose.search.search import Search
from gritd.tools.diagnose.verdict import forms
from gritd.tools.diagnose.verdict.calibration import Calibration, learnt
from gritd.tools.diagnose.verdict.decision import Decision, Verdict, WeighedModel
from gritd.tools.diagnose.verdict.nameless import nameless_evidence, remaining

ALIKE = 2.0  # log odds: effects that are less apart cannot be told apart
WEIGHED = 5  # models at most, of one effect and of more
NEAR, FAR = 0.5, 60.0  # within this share of the best gain, or so many nats of it
WHOLE, MUCH = 0.9, 20.0  # share of the misfit that an explanation takes, if it leaves so many nats
# belief in one that takes less: of eleven such in simulated cases none was right, of eight others
# all
PART = 0.1
POWER = 0.4  # share of the effects that must be detectable at their expected size for "consistent"
QUIET = 2.0  # temperature of the screen's evidence where nothing alarms


def decide(search: Search) -> Decision:
    """The verdict on a search."""
    base, screen = search.base, search.first
    if not screen.alarmed:
        verdict: Verdict = "consistent" if power(search, screen) >= POWER else "insufficient"
        return Decision(verdict, base, 1.0, 0.0, False, _quiet(screen), 0.0, {})
    return judged(search, weigh(search), nameless_evidence(search.screening, base), learnt())


def judged(
    search: Search, weighed: Sequence[WeighedModel], nameless: float, calibration: Calibration
) -> Decision:
    """The decision from the evidence of all explanations [nats above the base model]."""
    weights = np.array([calibration.listed(w.evidence, len(w.model.names)) for w in weighed])
    unnamed = calibration.unlisted(nameless)
    total = float(np.logaddexp(logsumexp(weights), unnamed)) if weighed else unnamed

    best = _best(weighed, weights) if weighed else search.base
    left, significant = remaining(search, best)
    gained = 0.5 * (search.base.fitted.objective - best.fitted.objective)
    share = gained / max(gained + left, 1e-9)
    beyond = left - max((_bending(w) for w in weighed if w.model is best), default=0.0)

    trusted = 1.0 - calibration.lapse
    believed = (PART if significant and beyond > MUCH and share < WHOLE else 1.0) * trusted
    unlisted = trusted - believed * -float(np.expm1(unnamed - total))
    return Decision(
        "explained" if weighed and unlisted < 0.5 * trusted else "unlisted",
        best,
        share,
        left,
        significant,
        _probabilities(weighed, weights - total + np.log(believed)),
        unlisted,
        _groups(weighed, weights, best),
        tuple(weighed),
        nameless,
    )


def _bending(weighed: WeighedModel) -> float:
    """Nats that another published form of the same effects takes of what they leave."""
    return float(weighed.evidence.max() - weighed.evidence[0])


def _best(weighed: Sequence[WeighedModel], weights: Array) -> Model:
    """The likeliest model of the likeliest number of effects: many alike sets of two weigh together
    against one.
    """
    sizes = np.array([len(w.model.names) for w in weighed])
    size = max(np.unique(sizes).tolist(), key=lambda n: float(logsumexp(weights[sizes == n])))
    return weighed[int(np.argmax(np.where(sizes == size, weights, -np.inf)))].model


def weigh(search: Search) -> list[WeighedModel]:
    """The models that may count, the most evident first."""
    base = search.base
    gains = {m: m.fitted.log_evidence - base.fitted.log_evidence for m in search.models if m.names}
    if not gains:
        return []

    top = max(gains.values())
    near = [m for m in gains if gains[m] > top - max(NEAR * top, FAR)]
    near.sort(key=lambda m: -gains[m])
    one, more = (
        [m for m in near if (len(m.names) == 1) == single][:WEIGHED] for single in (True, False)
    )
    return [
        WeighedModel(m, forms.evidence(search.problem, m.fitted, base.fitted))
        for m in (*one, *more)
    ]


def _probabilities(weighed: Sequence[WeighedModel], log_share: Array) -> dict[str, float]:
    """Weight of all models that hold an effect."""
    out: dict[str, float] = {}
    for w, share in zip(weighed, np.exp(log_share).tolist(), strict=True):
        for name in w.model.names:
            out[name] = out.get(name, 0.0) + share
    return out


def _quiet(screen: Screen) -> dict[str, float]:
    """Probabilities where nothing alarms: what the screen itself leaves to each effect."""
    listed = screen.listed
    weight = {
        n: float(np.exp(min(e, 20.0) / QUIET)) / max(len(listed), 1) for n, e in listed.items()
    }
    total = 20.0 + sum(weight.values())
    return {n: w / total for n, w in weight.items()}


def _groups(
    weighed: Sequence[WeighedModel], weights: Array, best: Model
) -> dict[str, tuple[str, ...]]:
    """For each effect of the best model, those that could stand in its place."""
    pairs = list(zip(weighed, weights.tolist(), strict=True))
    top = max((weight for m, weight in pairs if m.model is best), default=0.0)
    close = [
        weighed[i].model
        for i in np.argsort(-weights)
        if weighed[i].model is not best and top - weights[i] < ALIKE
    ]
    same = [m for m in close if len(m.names) == len(best.names)]

    groups: dict[str, tuple[str, ...]] = {}
    for name in best.names:
        rest = set(best.names) - {name}
        rivals = [m for m in same if rest <= set(m.names)]
        groups[name] = tuple(dict.fromkeys(n for m in rivals for n in m.names if n not in rest))
    return groups


def power(search: Search, screen: Screen) -> float:
    """Share of the listed effects that would be seen at their expected size."""
    projection = search.base.fitted.projection()
    seen = []
    for name, ready in screen.best.items():
        if isinstance(name, str):
            a, _ = projection.project(ready.columns)
            gain = 0.5 * np.trace(a) - 0.5 * np.log1p(np.maximum(np.diag(a), 0.0)).sum()
            seen.append(screen.surprise(name, float(gain)) > screen.threshold)
    return float(np.mean(seen)) if seen else 0.0
