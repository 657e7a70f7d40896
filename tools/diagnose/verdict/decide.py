"""From fitted models to a verdict, probabilities and groups.

Every explanation has an evidence: the discrepancy of form alone, listed effects with it,
unexplained terms instead of effects or beside them. `calibration.py` makes probabilities of these,
and `resemblance.py` says how far an effect of each is to be trusted. An effect has the weight of
all explanations that hold it, as far as it is trusted in them; `unlisted` has the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from gritd.estimator.effects import EFFECTS
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.parallel import each
from gritd.tools.diagnose.fit.attempt import attempted
from gritd.tools.diagnose.fit.evidence import log_bayes_expected
from gritd.tools.diagnose.fit.heldout import missed
from gritd.tools.diagnose.fit.model import Model, in_one_place, squares
from gritd.tools.diagnose.noise.colour import whiten
from gritd.tools.diagnose.screen.screening import Screen
from gritd.tools.diagnose.search.calibration import OddsCalibration
from gritd.tools.diagnose.search.models import EffectSearch
from gritd.tools.diagnose.search.search import counting, shared, without
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN
from gritd.tools.diagnose.verdict.decision import Decision, Resembled, Verdict, WeighedExplanation
from gritd.tools.diagnose.verdict.resemblance import doubted, likely, trusted
from gritd.tools.diagnose.verdict.unexplained import UnexplainedTerms, unexplained_with


def decide(
    search: EffectSearch, jobs: int = 1, step: Callable[[str], None] = lambda _: None
) -> Decision:
    """The verdict on a search.

    jobs: processes that fit; step: is given what begins.
    """
    screen = search.first
    if not screen.alarmed:
        power = len(shown(search, screen)) / max(len(search.problem.stack.rig.effects), 1)
        verdict: Verdict = "consistent" if power >= TUNING.verdict.power else "insufficient"
        return Decision(verdict, search.bare, 0.0, None, _quiet(search, screen), 0.0, {})

    step("weighing what has no name")
    best, by = search.best(), search.calibration
    beside = _beside(search, [search.bare, best] if best.names else [search.bare], jobs)
    if beside.get(best) is not None:  # what pays beside the best may pay beside its rivals
        tell = counting(step, "weighing what has no name")
        beside |= _beside(search, _rivals(search, best), jobs, tell)
    return judged(search, trusting(search, weigh(search, beside), by), beside, by)


def _beside(
    search: EffectSearch,
    models: Sequence[Model],
    jobs: int,
    tell: Callable[[int, int], None] = lambda done, of: None,
) -> dict[Model, UnexplainedTerms | None]:
    """What has no name beside each of some models. tell: is given how many of how many are done."""

    def nameless(model: Model) -> UnexplainedTerms | None:
        return _with_unexplained(search, model)

    made = each(jobs, nameless, models, shared(search), lambda done: tell(done, len(models)))
    return dict(zip(models, made, strict=True))


def _rivals(search: EffectSearch, best: Model) -> list[Model]:
    """The likeliest models of as many effects as the best one, and of fewer."""
    sizes = range(1, len(best.names) + 1)
    rivals = [m for size in sizes for m in search.sized(size)[: TUNING.verdict.rivals]]
    return [m for m in rivals if m is not best]


def weigh(
    search: EffectSearch, beside: Mapping[Model, UnexplainedTerms | None]
) -> list[WeighedExplanation]:
    """All explanations with their evidence [nats above the bare model].

    beside: unexplained terms beside some of the models, the bare one among these.
    """
    every = [WeighedExplanation(m, m.names, 0, search.gain(m)) for m in search.models[1:]]
    for model, nameless in beside.items():
        if nameless is not None:
            gain = search.gain(model) + nameless.gain
            count = len(nameless.functions)
            every.append(WeighedExplanation(nameless.model, model.names, count, gain))
    return every


def judged(
    search: EffectSearch,
    weighed: Sequence[WeighedExplanation],
    beside: Mapping[Model, UnexplainedTerms | None],
    calibration: OddsCalibration,
) -> Decision:
    """The decision from the evidence of all explanations. A name is accepted where it is likelier
    to be there than to be resembled, and likelier than that nothing of the list is there, or
    nothing beside the others. Where runs that were held out are predicted worse with what would be
    accepted, it is less likely, but for zeros that are set anew before each run.
    """
    weights = calibration.weights(
        np.array([w.evidence for w in weighed]),
        np.array([len(w.names) for w in weighed]),
        np.array([w.functions for w in weighed]),
        np.array([_companions(w, weighed) for w in weighed]),
    )
    shares = _by_fit(weighed, np.exp(weights - logsumexp(weights)))
    every = tuple(replace(w, probability=float(p)) for w, p in zip(weighed, shares, strict=True))

    best = _best([w for w in every if w.names] or every, _unlisted(every))
    first = _accepted(every, best)
    named, share, whole = _named(search, best, first, beside)
    if named.names and not _predicts(search, whole.model if whole is not None else named):
        every = tuple(_doubted(w, [n for n in first if not EFFECTS[n].free_along]) for w in every)
        named, share, whole = _named(search, best, _accepted(every, best), beside)

    return Decision(
        "explained" if named.names else "unlisted",
        named,
        share,
        whole,
        _probabilities(every),
        _unlisted(every),
        _groups(every, named if named.names else best.model),
        every,
        tuple(
            Resembled(name, best.share, best.model, name not in first)
            for name in best.names
            if name not in named.names and likely(_together(every)[frozenset(best.names)])
        ),
    )


def _by_fit(weighed: Sequence[WeighedExplanation], shares: Array) -> Array:
    """Shares (k,) of explanations, those of listed effects by how well these fit: a law that must
    be bent does not keep a name from one that fits. What they have together stays.
    """
    listed = np.array([bool(w.names) for w in weighed])
    fitting = shares * np.array([w.fitting for w in weighed])
    whole = float(fitting[listed].sum())
    return np.where(listed, fitting * shares[listed].sum() / max(whole, SPAN), shares)


def _companions(of: WeighedExplanation, weighed: Sequence[WeighedExplanation]) -> float:
    """How many of the effects and functions of an explanation only go with another: effects as far
    as they act in the channels of that one. Those of a trusted explanation are companions only
    where some of them are trusted without the others.
    """
    fewer = (w for w in weighed if set(w.names) < set(of.names) and not w.functions)
    apart = _trusted(of) and not any(map(_trusted, fewer))
    functions = of.functions if of.names else max(of.functions - 1, 0)
    return functions + (0.0 if apart else of.common)


def _trusted(of: WeighedExplanation) -> bool:
    return bool(of.names) and all(map(likely, of.trust))


def _accepted(weighed: Sequence[WeighedExplanation], best: WeighedExplanation) -> list[str]:
    """Names of the best explanation that are accepted, by how far they are to be trusted in it and
    in all explanations by the same effects: of several each must be likelier than the others alone.
    """
    own = next(w for w in weighed if w.model is best.model and not w.nameless)
    trust = _trust(weighed, best)
    probability, unlisted = _probabilities(weighed), _unlisted(weighed)

    def stated(name: str) -> bool:
        others = set(best.names) - {name}
        alone = sum(w.probability for w in weighed if set(w.names) <= others)
        trusted = likely(min(trust[name], own.trusts[name]))
        return trusted and probability[name] > max(unlisted, alone)

    return [name for name in best.names if stated(name)]


def _doubted(of: WeighedExplanation, names: Sequence[str]) -> WeighedExplanation:
    """An explanation whose effects of some names predict unseen runs worse."""
    trusts = of.trusts.items()
    return replace(of, trust=tuple(doubted(t) if n in names else t for n, t in trusts))


def _with_unexplained(search: EffectSearch, model: Model) -> UnexplainedTerms | None:
    return attempted(lambda: unexplained_with(search.screening, model))


def _predicts(search: EffectSearch, whole: Model) -> bool:
    """Whether a model misses less than the discrepancy of form alone of runs that were held out."""
    return missed(search.problem, whole.fitted) < missed(search.problem, search.bare.fitted)


def trusting(
    search: EffectSearch, weighed: Sequence[WeighedExplanation], by: OddsCalibration
) -> list[WeighedExplanation]:
    """Explanations with what their effects have in common, the share that these take, and how far
    they are to be trusted.
    """
    rig, made = search.problem.stack.rig, []
    for w in weighed:
        if w.names:
            share, shares = _taken(search, w.model)
            common = in_one_place(search.problem.stack, w.model)
            trust, fitting = trusted(rig, w.model, shares.tolist(), by)
            w = replace(w, common=common, share=share, trust=trust, fitting=fitting)
        made.append(w)
    return made


def _named(
    search: EffectSearch,
    best: WeighedExplanation,
    kept: Sequence[str],
    beside: Mapping[Model, UnexplainedTerms | None],
) -> tuple[Model, float, UnexplainedTerms | None]:
    """The model of the names that are accepted, the share that they take, and what has no name
    beside it.
    """
    model = best.model
    for name in best.names:
        if name not in kept:
            model = without(search, model, name)
    share = best.share if model is best.model else 0.0
    if model.names and model is not best.model:
        share = taken_share(search, model)
    return model, share, beside[model] if model in beside else _with_unexplained(search, model)


def _best(weighed: Sequence[WeighedExplanation], unlisted: float) -> WeighedExplanation:
    """The likeliest explanation of the likeliest number of effects: many alike sets of two weigh
    together against one. Of equally likely ones the one with the fewest parameters, but none that
    is less likely than that nothing of the list is there before one that is likelier.
    """
    sizes = {len(w.names) for w in weighed}
    size = max(sizes, key=lambda n: sum(w.probability for w in weighed if len(w.names) == n))
    together = _together(weighed)
    plain = [w for w in weighed if len(w.names) == size and not w.nameless]
    chance = {id(w): together[frozenset(w.names)] for w in plain}
    top = max(chance.values())
    equal = max(top / TUNING.verdict.equally_likely, min(unlisted, top))
    simple = [w for w in plain if chance[id(w)] >= equal]
    return min(simple, key=lambda w: (_parameters(w.model), -chance[id(w)]))


def _parameters(model: Model) -> int:
    return len(model.fitted.free)


def _together(weighed: Sequence[WeighedExplanation]) -> dict[frozenset[str], float]:
    """Probability of each set of effects, with unexplained terms beside it and without."""
    out: dict[frozenset[str], float] = {}
    for w in weighed:
        of = frozenset(w.names)
        out[of] = out.get(of, 0.0) + w.probability
    return out


def _trust(weighed: Sequence[WeighedExplanation], best: WeighedExplanation) -> dict[str, float]:
    """Of each effect of the best explanation, how far it is to be trusted, with unexplained terms
    beside it and without.
    """
    alike = [w for w in weighed if set(w.names) == set(best.names)]
    total = max(sum(w.probability for w in alike), SPAN)
    return {name: sum(w.probability * w.trusts[name] for w in alike) / total for name in best.names}


def taken_share(search: EffectSearch, model: Model) -> float:
    """Share of the misfit that a model's effects take, 0 to 1: of the squares beyond noise that it
    leaves when its effects are switched off and all else stays. Other forms of an effect do not
    count, but for profiles: how it goes along what no law tells of.
    """
    return _share(*_misfits(search, model).sum(axis=1))


def _taken(search: EffectSearch, model: Model) -> tuple[float, Array]:
    """The same, and for each effect (k,) that or the share which is taken of the misfit where it
    acts, if that is larger: the mean over channels, by what it does in each. What is wrong with
    another channel tells nothing against an effect.
    """
    misfits, done = _misfits(search, model), squares(search.problem.stack, model)
    share = _share(*misfits.sum(axis=1))
    each = np.array([_share(before, after) for before, after in misfits.T])
    where_it_acts = done @ each / np.maximum(done.sum(axis=1), SPAN)
    return share, np.maximum(where_it_acts, share)


def _misfits(search: EffectSearch, model: Model) -> Array:
    """Squares beyond noise without a model's effects, and with them (2, channels)."""
    fitted, stack = model.fitted, search.problem.stack
    off = search.problem.descend((), (), fitted.u, np.zeros(0), rounds=0)
    shared = np.zeros(fitted.residual.size)
    if stack.referred:  # what both campaigns do is no misfit
        shared = model.discrepancy()[1]
    left = (off.residual - shared, fitted.residual - shared - model.profiles()[1])
    return np.array([stack.by_channel(r**2 - 1.0) for r in left])


def _share(before: float, after: float) -> float:
    return float(np.clip(1.0 - max(after, 0.0) / max(before, SPAN), 0.0, 1.0))


def _probabilities(weighed: Sequence[WeighedExplanation]) -> dict[str, float]:
    """Weight of all explanations that hold an effect, as far as it is to be trusted in each."""
    out: dict[str, float] = {}
    for w in weighed:
        for name in w.names:
            out[name] = out.get(name, 0.0) + w.probability * w.trusts[name]
    return out


def _unlisted(weighed: Sequence[WeighedExplanation]) -> float:
    """Probability that none of the effects of the true explanation is there."""
    return sum(w.probability * (1.0 - w.listed) for w in weighed)


def _quiet(search: EffectSearch, screen: Screen) -> dict[str, float]:
    """Probabilities where nothing alarms: of each effect by the screen's evidence, against none."""
    listed = [n for n in screen.effects.effects]
    gains = np.array([screen.effects.gain(name) for name in listed])
    prior = np.log(TUNING.verdict.odds / max(len(search.problem.stack.rig.effects), 1))
    weights = np.array([*(prior + gains / search.calibration.temperature), 0.0])
    shares = np.exp(weights - logsumexp(weights))
    return dict(zip(listed, shares.tolist(), strict=False))


def _groups(weighed: Sequence[WeighedExplanation], best: Model) -> dict[str, tuple[str, ...]]:
    """For each effect of the best model, those that could stand in its place."""
    together = _together(weighed)
    sized = [w for w in weighed if len(w.names) == len(best.names) and not w.nameless]
    sized.sort(key=lambda w: -together[frozenset(w.names)])
    top = together.get(frozenset(best.names), 1.0)

    out: dict[str, tuple[str, ...]] = {}
    for name in best.names:
        rest = set(best.names) - {name}
        rivals = [
            w
            for w in sized
            if rest <= set(w.names)
            and w.model is not best
            and together[frozenset(w.names)] > top * np.exp(-TUNING.verdict.alike)
        ]
        out[name] = tuple(dict.fromkeys(n for w in rivals for n in w.names if n not in rest))
    return out


def shown(search: EffectSearch, screen: Screen) -> list[str]:
    """The listed effects that would be seen at their expected size; those that change nothing
    measured would not. Beside a reference that was driven elsewhere little would.
    """
    projection = search.base.fitted.projection()
    seen = []
    for name, likeliest in screen.best.items():
        a, _ = projection.project(whiten(search.problem.noise, likeliest.columns))
        if screen.seen(name, likeliest.prior + log_bayes_expected(np.diag(a))):
            seen.append(name)
    return seen
