"""From one pass to models: nonlinear fits of the likely effects, then of pairs and of triples.

A pass (screen/evidence.py) tells by linear algebra which effects may explain the recordings. The
likeliest are fitted. Beside the best two fits, and then beside the best pair, another pass tells
what one more effect would gain. The likeliest of all pairs are fitted too: of two effects each may
hide the other. Each effect of the best model must stand beside the others: so the model is fitted
without each too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from gritd.estimator.effects.base import order_of
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.memory import give_back
from gritd.tools.cli.parallel import each
from gritd.tools.diagnose.fit.attempt import attempted
from gritd.tools.diagnose.fit.model import Model, does, fit_model
from gritd.tools.diagnose.fit.problem import Free, Maker, free_of
from gritd.tools.diagnose.fit.signatures import resolved_order
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.screen.evidence import Pass, one_pass
from gritd.tools.diagnose.screen.screening import Screening, screen
from gritd.tools.diagnose.search.foretold import Predicted, gains, passed, standing, together
from gritd.tools.diagnose.search.models import EffectSearch
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SLIGHT

FURTHER = {1: "second", 2: "third"}  # effect, beside so many


def search_models(
    screening: Screening, step: Callable[[str], None] = lambda _: None, jobs: int = 1
) -> EffectSearch:
    """Forward steps from the bare model if the screen alarms.

    jobs: processes that fit.
    """
    step("screening every effect")
    search = begin(screening, jobs)
    give_back()  # of all that was screened
    if not search.first.alarmed:
        return search

    tell = counting(step, "fitting the likely effects")
    search = extended(search, [search.bare], TUNING.search.effects_first, jobs, tell)
    search = _from_each_other(search, jobs)
    tested: Model | None = None
    for size, (starts, most) in enumerate(TUNING.search.later, start=1):
        if begun := search.sized(size)[:starts]:
            names = ", or ".join(" and ".join(m.names) for m in begun)
            tell = counting(step, f"looking for a {FURTHER[size]} effect beside {names}")
            also = together(search) if size == 1 else []
            search = extended(search, begun, most, jobs, tell, also)
        if (best := search.best()) is not tested:
            search, tested = _retested(search, best, jobs), best
        if len(search.best().names) <= size:
            break
    return search


def begin(screening: Screening, jobs: int = 1) -> EffectSearch:
    """The base model, the bare one, and what stands out beside it."""
    base, forms = screening.base, screening.forms
    start, sizes = (base.fitted.u, np.zeros(0)), base.sizes or tuple(0 for _ in forms)
    bare = fit_model(screening.problem, forms, (), (), start, sizes, near=base.fitted)
    first = screen(screening, bare, jobs)
    search = EffectSearch(screening, (base, bare), first, bare, first.effects)
    if not first.alarmed:
        return search

    def look(stand: Model) -> Pass:
        return one_pass(screening.problem, stand, jobs)

    stand, seen = passed(standing(screening, bare), look, [first.effects])
    return replace(search, stand=stand, passed=seen)


def _from_each_other(search: EffectSearch, jobs: int) -> EffectSearch:
    """With the models of one effect that are nearly as likely as the best, each fitted again from
    the constants of the likeliest other: none may be likelier for where its fit began.
    """
    likely = search.sized(1)[: TUNING.search.again]
    alike = [m for m in likely if m.evidence > likely[0].evidence - 2.0 * TUNING.search.little]
    if len(alike) < 2:
        return search
    first, second, *_ = alike
    begins = [(first, second), *((model, first) for model in alike[1:])]

    def again(model: Model, other: Model) -> Model:
        begun, near = (other.fitted.u, model.fitted.x), model.fitted
        return fit_model(
            search.problem, search.screening.forms, near.effects, near.free, begun, model.sizes,
            model.other_forms, near,
        )  # fmt: skip

    made = each(jobs, lambda pair: attempted(lambda: again(*pair)), begins, shared(search))
    fits = [model for model in made if model is not None]
    return replace(search, models=tuple(_the_better((*search.models, *fits))))


# ---- one more effect ---------------------------------------------------------------------------


def extended(
    search: EffectSearch,
    starts: Sequence[Model],
    most: int,
    jobs: int,
    tell: Callable[[int, int], None] = lambda done, of: None,
    also: Sequence[Predicted] = (),
) -> EffectSearch:
    """With fits of some models and one more effect, the likeliest by linear algebra; no two of the
    same effects.

    tell: is given how many of how many fits are done; of none before their number is known. also:
    what is fitted beside these.
    """
    tell(0, 0)
    every = [p for model in starts for p in gains(search, model, jobs)]
    wanted: dict[frozenset[str], Predicted] = {}
    for predicted in sorted(every, key=lambda p: -p.evidence):
        if len(wanted) < most and not search.has(predicted.names):
            wanted.setdefault(predicted.names, predicted)
    for predicted in also:
        wanted.setdefault(predicted.names, predicted)

    def fitted(predicted: Predicted) -> Model | None:
        return attempted(lambda: _acting(search, _with_effect(search, predicted)))

    fits = list(wanted.values())
    made = each(jobs, fitted, fits, shared(search), lambda done: tell(done, len(fits)))
    pairs = list(zip(fits, made, strict=True))
    failed = tuple((*p.model.names, p.effect) for p, model in pairs if model is None)
    reached = [(p, model) for p, model in pairs if model is not None]

    def fitted_again(pair: tuple[Predicted, Model]) -> Model | None:
        return attempted(lambda: _acting(search, _from_elsewhere(search, *pair)))

    behind, count = _behind(reached), len(fits)
    whole = count + len(behind)
    more = each(jobs, fitted_again, behind, shared(search), lambda done: tell(count + done, whole))
    models = (*search.models, *(m for _, m in reached), *(m for m in more if m is not None))
    return replace(search, models=tuple(_the_better(models)), failed=(*search.failed, *failed))


def _behind(reached: Sequence[tuple[Predicted, Model]]) -> list[tuple[Predicted, Model]]:
    """Fits that ended well below what linear algebra foretold, where that rivals the best fit."""
    little, best = TUNING.search.little, max((m.evidence for _, m in reached), default=0.0)
    return [(p, m) for p, m in reached if p.evidence > max(m.evidence + little, best - little)]


def _acting(search: EffectSearch, model: Model) -> Model:
    """A model, or what is left of it without an effect that does nothing where its fit stands."""
    if len(model.names) < 2:
        return model
    idle = [name for name, size in does(model.fitted).items() if size < SLIGHT]
    return _acting(search, _changed(search, model, idle[0])) if idle else model


def counting(step: Callable[[str], None], what: str) -> Callable[[int, int], None]:
    """Tells what is done, and how many of how many fits of it are."""
    return lambda done, of: step(f"{what}, {done} of {of}" if of else what)


def shared(search: EffectSearch) -> list[object]:
    """What fits of a search hold: its terms and its models."""
    allowed = (term for term, _ in search.problem.nuisance.parts)
    return [*allowed, *search.screening.forms, *search.models]


def _with_effect(search: EffectSearch, predicted: Predicted) -> Model:
    """The model with one more effect, the best of its starts; the first effect that is new begins
    where the reference puts the constants.
    """
    known, model = search.screening.usual, predicted.model
    constants = predicted.stand.fitted.u if model.names or known is None else known
    begins = [(one.start, one.sizes, constants) for one in predicted.starts]
    return max((_fitted_with(search, predicted, *b) for b in begins), key=lambda m: m.evidence)


def _from_elsewhere(search: EffectSearch, predicted: Predicted, made: Model) -> Model:
    """The same without any discrepancy at the start, which may have taken the effect's part; where
    the fit ended well below the model that it holds also from there, with the effect's strengths
    at nought.
    """
    model, effect = predicted.model, search.problem.stack.rig.effects[predicted.effect]
    start, u = predicted.starts[0].start, model.fitted.u
    begins = [(start, tuple(0 for _ in model.chosen), u)]
    if made.evidence <= model.evidence - TUNING.search.little:
        strengths = [p.role == "strength" for p in effect.parameters()]
        begins.append((np.where(strengths, 0.0, start), model.chosen, u))
    return max((_fitted_with(search, predicted, *b) for b in begins), key=lambda m: m.evidence)


def _fitted_with(
    search: EffectSearch, predicted: Predicted, start: Array, sizes: tuple[int, ...], u: Array
) -> Model:
    """start (p,) of the effect's parameters; sizes: of all terms of the model beside it; u (q,):
    constants.
    """
    fitted, screening = predicted.model.fitted, search.screening
    effect = search.problem.stack.rig.effects[predicted.effect]
    effects: tuple[Maker, ...] = (*fitted.effects, effect)
    free = (*fitted.free, *_free_near(search.problem.stack.rig, predicted.effect, start))
    begins = (u, np.concatenate((fitted.x, start)))
    forms, count = screening.forms, len(screening.forms)
    errors = replace(predicted.model.other_forms, sizes=sizes[count:])
    near = predicted.stand.fitted
    return fit_model(screening.problem, forms, effects, free, begins, sizes[:count], errors, near)


def _free_near(rig: Rig, name: str, start: Array) -> tuple[Free, ...]:
    """The parameters of an effect. Its ripples a turn stay as near to where they begin as the
    longest run resolves: farther off they are another ripple, and spectra at the recordings' own
    rate were searched for those.
    """
    effect = rig.effects[name]
    order, near = order_of(effect), resolved_order(rig)
    free = []
    for known, x in zip(free_of((effect,)), start.tolist(), strict=True):
        p, value = known.parameter, known.value(x)
        if p.name == order:
            p = replace(p, low=max(p.low, value - near), high=min(p.high, value + near))
        free.append(replace(known, parameter=p))
    return tuple(free)


# ---- one effect less, or another in its place ---------------------------------------------------


def _retested(search: EffectSearch, best: Model, jobs: int) -> EffectSearch:
    """With the best model less each of its effects, where that was not fitted: each must stand. And
    with others in the place of one: what alone is as likely as it may be so beside the rest.
    """
    if len(best.names) < 2:
        return search

    def changed(change: tuple[str, Model | None]) -> Model | None:
        return attempted(lambda: _acting(search, _changed(search, best, *change)))

    names = [name for name in best.names if not search.has({*best.names} - {name})]
    changes = [*((name, None) for name in names), *_rivals(search, best)]
    made = each(jobs, changed, changes, shared(search))
    again = [model for model in made if model is not None]
    return replace(search, models=tuple(_the_better((*search.models, *again))))


def _rivals(search: EffectSearch, best: Model) -> Iterator[tuple[str, Model]]:
    """Of each effect of a model, those that are as likely alone and stand in no model like it."""
    alone = {model.names[0]: model for model in search.sized(1)}
    for name in (n for n in best.names if n in alone):
        least = alone[name].evidence - TUNING.search.little
        for rival in search.sized(1)[: TUNING.search.again]:
            instead = {*best.names, *rival.names} - {name}
            further = rival.names[0] not in best.names and not search.has(instead)
            if further and rival.evidence > least:
                yield name, rival


def _the_better(models: Sequence[Model]) -> Iterator[Model]:
    """The first two, and of the others the likeliest of each set of effects."""
    best: dict[frozenset[str], Model] = {}
    for model in models[2:]:
        of = frozenset(model.names)
        if of not in best or model.evidence > best[of].evidence:
            best[of] = model
    return chain(models[:2], best.values())


def without(search: EffectSearch, model: Model, name: str) -> Model:
    """A model less one of its effects: of the search, or fitted for the question."""
    kept = tuple(n for n in model.names if n != name)
    if not kept:
        return search.bare
    known = [m for m in search.models if set(m.names) == set(kept)]
    return max(known, key=lambda m: m.evidence) if known else _changed(search, model, name)


def _changed(search: EffectSearch, model: Model, leave: str, rival: Model | None = None) -> Model:
    """A model of several effects less one, or with that of another model in its place, fitted from
    where both stand.
    """
    fitted, kept = model.fitted, tuple(n for n in model.names if n != leave)
    types = tuple(e for e, n in zip(fitted.effects, model.names, strict=True) if n != leave)
    still = [f.name != leave for f in fitted.free]
    free = tuple(f for f, stays in zip(fitted.free, still, strict=True) if stays)
    x = fitted.x[np.array(still, bool)]
    if rival is not None:
        types, free = (*types, *rival.fitted.effects), (*free, *rival.fitted.free)
        x = np.concatenate((x, rival.fitted.x))
    screening, errors = search.screening, model.other_forms.of(kept)
    forms, begins = screening.forms, (fitted.u, x)
    return fit_model(screening.problem, forms, types, free, begins, model.sizes, errors, fitted)
