"""From the screen to models: nonlinear fits of the likely effects, one more at a time, earlier ones
re-tested.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.estimator.effects.base import Effect
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Fitted, FreeParameter, Maker, Problem, free_of
from gritd.tools.diagnose.fit.signatures import strengths
from gritd.tools.diagnose.screen.screen import Screen, WhitenedSignature
from gritd.tools.diagnose.screen.screening import Screening, screen_beside
from gritd.tools.diagnose.search.parallel import each

REACH = 0.35  # of the best effect's evidence: less cannot catch up in the nonlinear fit
MOST = 9  # effects fitted at the first step
PAIRS = 2  # first effects from which a second step starts
SECOND = 5  # effects fitted at each further step
STEPS = 3  # effects at most
QUICK, THOROUGH = 2, 8  # rounds of a first fit, and of one that may win
# [nats] behind the best after the first fit, or this share of what the best gained
HOPELESS, BEHIND = 12.0, 0.15
PAIR_PRIOR = -3.0  # [nats] log odds of one more effect at work
# of what the effects so far gained: what a published form other than ours may leave for another
# effect
FORM, FORM_MOST = 0.08, 25.0


@dataclass(frozen=True)
class Search:
    """All models that were fitted, the base model first, and the screens beside some of them."""

    screening: Screening
    models: tuple[Model, ...]
    screens: Mapping[Model, Screen]

    @property
    def problem(self) -> Problem:
        return self.screening.problem

    @property
    def base(self) -> Model:
        return self.models[0]

    @property
    def first(self) -> Screen:
        """Beside the base model."""
        return self.screens[self.base]

    def best(self, size: int | None = None) -> Model:
        """The most evident model, of so many effects."""
        sized = (m for m in self.models if size is None or len(m.names) == size)
        return max(sized, key=lambda m: m.evidence)

    def has(self, names: Sequence[str]) -> bool:
        return any(set(m.names) == set(names) for m in self.models)

    def screen_of(self, model: Model) -> Screen:
        """The screen beside any model: one of the search, or made for the question."""
        return self.screens.get(model) or screen_beside(self.screening, model, self.first)


def search_models(
    screening: Screening, step: Callable[[str], None] = lambda _: None, jobs: int = 1
) -> Search:
    """Forward steps from the base model while the screen alarms; each from the best few models of
    the step before.

    jobs: processes that fit.
    """
    step("screening every effect")
    search = begin(screening)
    if not search.first.alarmed:
        return search

    step("fitting the likely effects")
    search = extended(search, search.base, MOST, jobs)
    for size in range(1, STEPS):
        starts = _starts(search, size)
        for model in starts:
            step(f"looking beside {' and '.join(model.names)}")
            search = screened(search, model)
            if search.screens[model].alarmed:
                search = extended(search, model, SECOND, jobs)

        if not starts or not any(len(m.names) == size + 1 for m in search.models):
            return search
        search = _retested(search)
        if len(search.best().names) <= size:
            return search
    return search


def begin(screening: Screening) -> Search:
    """The base model and its screen."""
    base = screening.base
    return Search(screening, (base,), {base: screen_beside(screening, base)})


def screened(search: Search, model: Model) -> Search:
    """With the screen beside one more of its models."""
    return replace(search, screens={**search.screens, model: search.screen_of(model)})


def _starts(search: Search, size: int) -> list[Model]:
    """The best few models of so many effects, as far as they may win."""
    best = search.best().evidence
    sized = sorted((m for m in search.models if len(m.names) == size), key=lambda m: -m.evidence)
    return [m for m in sized[:PAIRS] if m.evidence > best - _hopeless(search, best)]


def likely(screen: Screen, names: Sequence[str], most: int) -> list[str]:
    """Listed effects within reach of the best, most likely first."""
    listed = sorted((n for n in screen.listed if n in names), key=lambda n: -screen.evidence[n])
    if not listed:
        return []
    top = max(screen.evidence[listed[0]], 0.0)
    return [n for n in listed if screen.evidence[n] >= min(REACH * top, top - 6.0)][:most]


def extended(search: Search, model: Model, most: int, jobs: int) -> Search:
    """With fits of the model and one more effect each; those that may win are fitted to the end."""
    effects, screen = search.problem.stack.rig.effects, search.screens[model]
    names = [n for n in likely(screen, list(effects), most) if not search.has((*model.names, n))]
    made = each(jobs, lambda name: _fitted(search, model, effects[name], screen.best[name]), names)

    if made:
        top = max(max(m.evidence for m in made), search.best().evidence)
        behind = _hopeless(search, top)
        foreseen = max(screen.evidence[m.names[-1]] for m in made) - behind
        close = [
            m for m in made if m.evidence > top - behind or screen.evidence[m.names[-1]] > foreseen
        ]
        done = iter(each(jobs, lambda m: _finished(search.problem, m), close))
        made = [next(done) if m in close else m for m in made]

    return replace(search, models=(*search.models, *made))


def _hopeless(search: Search, top: float) -> float:
    """How far behind the best evidence a model may be and still win: rivals for a strong effect
    differ by much.
    """
    return max(HOPELESS, BEHIND * (top - search.base.evidence))


def _finished(problem: Problem, model: Model) -> Model:
    return replace(model, fitted=problem.refine(model.fitted, THOROUGH))


def _fitted(search: Search, model: Model, effect: type[Effect], best: WhitenedSignature) -> Model:
    """One more effect, started at its linear estimate."""
    a, b = model.fitted.projection().project(best.columns)
    amplitude = np.asarray(np.linalg.solve(a + 0.1 * np.eye(len(b)), b))
    amplitude = np.where(np.array(best.signature.sign) > 0, np.maximum(amplitude, 0.02), amplitude)

    more = free_of((effect,))
    x = np.concatenate((model.fitted.x, _start(more, effect, amplitude, best.signature.fixed)))
    effects: tuple[Maker, ...] = (*model.fitted.effects, effect)
    free = (*model.fitted.free, *more)
    fitted = search.problem.descend(effects, free, model.fitted.u, x, QUICK)
    return Model(fitted, (*model.names, effect.name), model.log_prior + _one_more(search, model))


def _one_more(search: Search, model: Model) -> float:
    """Log prior of one more effect beside those of a model."""
    gained = model.fitted.log_evidence - search.base.fitted.log_evidence
    return PAIR_PRIOR - form(gained) if model.names else 0.0


def form(gained: float) -> float:
    """What the remainder of another published form may be worth [nats]."""
    return float(np.clip(FORM * gained, 0.0, FORM_MOST))


def _start(
    free: Sequence[FreeParameter],
    effect: type[Effect],
    amplitude: Array,
    fixed: Mapping[str, float],
) -> Array:
    """Where the fit of an effect's parameters begins, in their units."""
    size = dict(zip((p.name for p in strengths(effect)), amplitude.tolist(), strict=True))
    values = []
    for f in free:
        p = f.parameter
        values.append(size[p.name] if p.name in size else (fixed[p.name] - p.centre) / p.sigma)
    return np.asarray(np.clip(np.array(values), -20.0, 20.0))


def _retested(search: Search) -> Search:
    """With the best model less each of its effects, if that was not fitted yet."""
    best, effects = search.best(), search.problem.stack.rig.effects
    for leave in best.names[:-1]:
        kept = tuple(n for n in best.names if n != leave)
        if kept and not search.has(kept):
            types = tuple(effects[n] for n in kept)
            free = free_of(types)
            x = np.array([_at(best.fitted, f) for f in free])
            fitted = search.problem.descend(types, free, best.fitted.u, x)
            prior = _one_more(search, search.best(1)) * (len(kept) - 1)
            search = replace(search, models=(*search.models, Model(fitted, kept, prior)))

    return search


def _at(fitted: Fitted, wanted: FreeParameter) -> float:
    return float(next(x for f, x in zip(fitted.free, fitted.x, strict=True) if f == wanted))
