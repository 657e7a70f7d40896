"""From the screen to models: nonlinear fits of the likely effects, one more at a time, earlier ones
re-tested.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from gritd.estimator.effects.base import order_of
from gritd.tools.cli.memory import give_back
from gritd.tools.cli.parallel import each
from gritd.tools.diagnose.fit.attempt import attempted
from gritd.tools.diagnose.fit.model import Model, fit_model
from gritd.tools.diagnose.fit.problem import Free, Maker, Problem, free_of
from gritd.tools.diagnose.fit.signatures import resolved_order
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.screen.screen import Screen
from gritd.tools.diagnose.screen.screening import Screening, screen_of_base, with_form_open
from gritd.tools.diagnose.search.promises import Promise, promises
from gritd.tools.diagnose.tuning import TUNING

FURTHER = {1: "second", 2: "third"}  # effect, beside so many


@dataclass(frozen=True)
class Search:
    """All models that were fitted, and the screen beside the base model.

    models: the base model first, exact in its form; then the base model with the form's learnt
        discrepancy, where there is a mismatch; then those with effects.
    """

    screening: Screening
    models: tuple[Model, ...]
    first: Screen
    failed: tuple[tuple[str, ...], ...] = ()  # effects whose fit ended in a numerical failure

    @property
    def problem(self) -> Problem:
        return self.screening.problem

    @property
    def base(self) -> Model:
        """Exact in its form."""
        return self.models[0]

    @property
    def bare(self) -> Model:
        """Without effects, with the discrepancy of form that the recordings ask for."""
        return self.models[1] if len(self.models) > 1 else self.models[0]

    def news(self, model: Model) -> float:
        """Log evidence beyond what a reference campaign shows of the model's effects [nats]."""
        usual = sum(self.first.habit.get(name, 0.0) for name in model.names)
        return float(model.evidence - TUNING.screen.habit * usual)

    def weight(self, model: Model) -> float:
        """Log evidence and log prior of so many effects, above the bare model's [nats]."""
        more = np.log(TUNING.search.odds / max(len(self.problem.stack.rig.effects), 1))
        return float(self.news(model) - self.bare.evidence + max(len(model.names) - 1, 0) * more)

    def sized(self, size: int) -> list[Model]:
        """Models of so many effects, the likeliest first."""
        return sorted((m for m in self.models if len(m.names) == size), key=lambda m: -m.evidence)

    def best(self) -> Model:
        """The likeliest model with effects, or the bare one."""
        return max(self.models[1:] or self.models, key=self.weight)

    def has(self, names: Collection[str]) -> bool:
        return any(set(m.names) == set(names) for m in self.models)


def search_models(
    screening: Screening, step: Callable[[str], None] = lambda _: None, jobs: int = 1
) -> Search:
    """Forward steps from the base model if the screen alarms; each from the best few models of the
    step before.

    jobs: processes that fit.
    """
    step("screening every effect")
    search = begin(screening, jobs)
    give_back()  # of all that was screened
    bare = _bare(search, search.base)
    first = with_form_open(screening, bare, search.first)
    search = replace(search, models=(search.base, bare), first=first)
    if not search.first.alarmed:
        return search

    tell = counting(step, "fitting the likely effects")
    search = extended(search, [search.bare], TUNING.search.effects_first, jobs, tell)
    if search.problem.stack.referred:
        tell = counting(step, "looking beside what the reference tells by itself")
        search = extended(search, [search.base], TUNING.search.effects_later, jobs, tell)
    search = _settled(search)
    tested: Model | None = None
    for size in range(1, TUNING.search.most_effects):
        starts = [m for m in search.sized(size)[: TUNING.search.starts] if _near(search, m)]
        if starts:
            names = ", or ".join(" and ".join(m.names) for m in starts)
            tell = counting(step, f"looking for a {FURTHER[size]} effect beside {names}")
            search = extended(search, starts, TUNING.search.effects_later, jobs, tell)
        if (best := search.best()) is not tested:
            search, tested = _retested(search, best, jobs), best
        if len(search.best().names) <= size:
            break
    return search


def begin(screening: Screening, jobs: int = 1) -> Search:
    """The base model and its screen."""
    base = screening.base
    return Search(screening, (base,), screen_of_base(screening, jobs))


def _bare(search: Search, start: Model) -> Model:
    """The model without effects from the constants of another, its discrepancy learnt."""
    screening = search.screening
    sizes = start.sizes or tuple(0 for _ in screening.forms)
    begins = (start.fitted.u, np.zeros(0))
    return fit_model(screening.problem, screening.forms, (), (), begins, sizes, near=start.fitted)


def _the_better(models: Sequence[Model]) -> Iterator[Model]:
    """The first two, and of the others the likeliest of each set of effects."""
    best: dict[frozenset[str], Model] = {}
    for model in models[2:]:
        of = frozenset(model.names)
        if of not in best or model.evidence > best[of].evidence:
            best[of] = model
    return chain(models[:2], best.values())


def _settled(search: Search) -> Search:
    """With the bare model fitted again from where the best effect found its constants: no model may
    be worse than one that it holds.
    """
    again = _bare(search, search.best())
    if again.evidence <= search.bare.evidence:
        return search
    return replace(search, models=(search.base, again, *search.models[2:]))


def _near(search: Search, model: Model) -> bool:
    return search.weight(model) > search.weight(search.best()) - TUNING.search.little


# ---- one more effect ---------------------------------------------------------------------------


def extended(
    search: Search,
    starts: Sequence[Model],
    most: int,
    jobs: int,
    tell: Callable[[int, int], None] = lambda done, of: None,
) -> Search:
    """With fits of each of some models and one more effect, so many of each at most, but no two of
    the same effects.

    tell: is told how many of how many fits are done; of none before their number is known.
    """
    tell(0, 0)
    wanted: dict[frozenset[str], tuple[Model, Promise]] = {}
    for model in starts:
        every = promises(search.problem, search.first, model, jobs)
        least = _least_promise(model, every)
        candidates = [p for p in every if p.gain > least]
        fresh = [(frozenset((*model.names, p.effect.name)), p) for p in candidates]
        fresh = [(names, p) for names, p in fresh if names not in wanted and not search.has(names)]
        wanted |= {names: (model, promise) for names, promise in fresh[:most]}

    def fitted(of: tuple[Model, Promise]) -> Model | None:
        with search.problem.stack.rig.aside():  # the same bits, whatever was fitted before
            return attempted(lambda: _with_effect(search, *of))

    fits = list(wanted.values())
    made = each(jobs, fitted, fits, shared(search), lambda done: tell(done, len(fits)))
    models = (*search.models, *(model for model in made if model is not None))
    told = zip(wanted.values(), made, strict=True)
    failed = tuple((*start.names, p.effect.name) for (start, p), model in told if model is None)
    return replace(search, models=models, failed=(*search.failed, *failed))


def _least_promise(model: Model, every: Sequence[Promise]) -> float:
    """What an effect must gain by linear algebra beside a model to be fitted [nats]: a share of the
    best, which a fit may turn round; one more effect also some of what the verdict asks of it.
    """
    alone = TUNING.search.little if model.names else TUNING.search.promising
    top = max((promise.gain for promise in every), default=0.0)
    return max(alone, TUNING.search.promised_share * top - TUNING.search.promised_less)


def counting(step: Callable[[str], None], what: str) -> Callable[[int, int], None]:
    """Tells what is done, and how many of how many fits of it are."""
    return lambda done, of: step(f"{what}, {done} of {of}" if of else what)


def shared(search: Search) -> list[object]:
    """What fits of a search hold: its freedoms and its models."""
    allowed = (freedom for freedom, _ in search.problem.allowance.parts)
    return [*allowed, *search.screening.forms, *search.models]


def _with_effect(search: Search, model: Model, promise: Promise) -> Model:
    """The model with one more effect, the best of its starts. Where it ends well below the model
    that it holds, it has lost its way: it is fitted again from there, with the effect's strengths
    at nought.
    """
    every = [_fitted_with(search, model, start) for start in (promise, *promise.others)]
    made = max(every, key=lambda m: m.evidence)
    if made.evidence > model.evidence - TUNING.search.little:
        return made

    strengths = [p.role == "strength" for p in promise.effect.parameters()]
    none = replace(promise, start=np.where(strengths, 0.0, promise.start), sizes=model.sizes)
    return max(made, _fitted_with(search, model, none), key=lambda m: m.evidence)


def _fitted_with(search: Search, model: Model, promise: Promise) -> Model:
    fitted, screening = model.fitted, search.screening
    effects: tuple[Maker, ...] = (*fitted.effects, promise.effect)
    free = (*fitted.free, *_free_near(search.problem.stack.rig, promise))
    begins = (fitted.u, np.concatenate((fitted.x, promise.start)))

    return fit_model(
        screening.problem,
        screening.forms,
        effects,
        free,
        begins,
        promise.sizes,
        model.other_forms,
        fitted,
    )


def _free_near(rig: Rig, promise: Promise) -> tuple[Free, ...]:
    """The parameters of a promised effect. Its ripples a turn stay as near to where they begin as
    the longest run resolves: farther off they are another ripple, and spectra at the recordings'
    own rate were searched for those.
    """
    order, near = order_of(promise.effect), resolved_order(rig)
    free = []
    for known, x in zip(free_of((promise.effect,)), promise.start.tolist(), strict=True):
        p, value = known.parameter, known.value(x)
        if p.name == order:
            p = replace(p, low=max(p.low, value - near), high=min(p.high, value + near))
        free.append(replace(known, parameter=p))
    return tuple(free)


def _retested(search: Search, best: Model, jobs: int) -> Search:
    """With the best model less each of its effects, fitted from where the best one stands: no
    effect may owe its place to a fit of the others that ended elsewhere.
    """
    if len(best.names) < 2:
        return search

    def less(leave: str) -> Model | None:
        return attempted(lambda: _less(search, best, leave))

    made = each(jobs, less, best.names, shared(search))
    again = [model for model in made if model is not None]
    return replace(search, models=tuple(_the_better((*search.models, *again))))


def without(search: Search, model: Model, name: str) -> Model:
    """A model less one of its effects: of the search, or fitted for the question."""
    kept = tuple(n for n in model.names if n != name)
    if not kept:
        return search.bare
    known = [m for m in search.models if set(m.names) == set(kept)]
    return max(known, key=lambda m: m.evidence) if known else _less(search, model, name)


def _less(search: Search, model: Model, name: str) -> Model:
    """A model less one of its several effects, fitted from where it stands."""
    fitted, kept = model.fitted, tuple(n for n in model.names if n != name)
    types = tuple(e for e, n in zip(fitted.effects, model.names, strict=True) if n != name)
    still = [f.name != name for f in fitted.free]
    free = tuple(f for f, stays in zip(fitted.free, still, strict=True) if stays)
    begins = (fitted.u, fitted.x[np.array(still, bool)])
    screening, bends = search.screening, model.other_forms.of(kept)
    with search.problem.stack.rig.aside():  # the same bits, whatever was fitted before
        return fit_model(
            screening.problem, screening.forms, types, free, begins, model.sizes, bends, fitted
        )
