"""From the screen to models: nonlinear fits of the likely effects, one more at a time, earlier ones
re-tested.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from gritd.estimator.effects.base import Effect
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import Base, Signature
from gritd.tools.diagnose.fit.problem import Fitted, Free, Maker, Problem, free_of
from gritd.tools.diagnose.fit.signatures import shape_grid, signature, strengths
from gritd.tools.diagnose.screen import scans
from gritd.tools.diagnose.screen.open_colour import OpenNoise
from gritd.tools.diagnose.screen.ripples import LOUDEST, loudest, order_of
from gritd.tools.diagnose.screen.screen import SURE, Screen, Whitened, screen, whitened
from gritd.tools.diagnose.search.parallel import each

REACH = 0.35  # of the best effect's evidence: less cannot catch up in the nonlinear fit
MOST = 9  # effects fitted at the first step
PAIRS = 2  # first effects from which a second step starts
SECOND = 5  # effects fitted at each further step
STEPS = 3  # effects at most
WEIGHED = 6  # names that stand out whose evidence is weighed with the noise's colour open
AGAIN = 4  # shapes of an effect that a later screen tries
QUICK, THOROUGH = 2, 8  # rounds of a first fit, and of one that may win
HOPELESS, BEHIND = (
    12.0,
    0.15,
)  # [nats] behind the best after the first fit, or this share of what the best gained
PAIR_PRIOR = -3.0  # [nats] log odds of one more effect at work
FORM, FORM_MOST = (
    0.08,
    25.0,
)  # of what the effects so far gained: what a published form other than ours may leave for another effect


@dataclass(eq=False)
class Model:
    """A set of effects and its fit."""

    fitted: Fitted
    names: tuple[str, ...]
    log_prior: float

    @property
    def evidence(self) -> float:
        return self.fitted.log_evidence + self.log_prior


@dataclass
class Search:
    """All models that were fitted, the screens on the way."""

    problem: Problem
    generics: list[Signature]
    draws: tuple[Array, Array]
    models: list[Model] = field(default_factory=list)
    screens: dict[tuple[str, ...], Screen] = field(default_factory=dict)
    jobs: int = 1  # processes that fit

    @cached_property
    def scans(self) -> list[scans.Family]:
        """Misfits without a name that must be searched for."""
        return scans.families(self.problem.stack, self.problem.noise, self.draws[0])

    def best(self, size: int | None = None) -> Model:
        return max(
            (m for m in self.models if size is None or len(m.names) == size),
            key=lambda m: m.evidence,
        )

    def has(self, names: Sequence[str]) -> bool:
        return any(set(m.names) == set(names) for m in self.models)


def rescreen(search: Search, model: Model) -> Screen:
    """Evidence for one more effect, and for a smooth misfit, on top of a model."""
    base = model.fitted.base()
    signatures = list(_beside(search, model))
    ready = whitened(search.problem.noise, [*signatures, *search.generics])
    noise, strain = search.draws
    beside = scans.without_harmonics(search.problem, model.fitted)
    left = scans.Left(beside, noise, _resized(strain, beside))
    searched = {family.name: family.average(left) for family in search.scans}
    found = screen(base, ready, (noise, _resized(strain, base)), searched)
    if (
        not model.names
    ):  # whether there is a mismatch at all; beside an effect, explanations compete on even terms
        found = replace(found, open=_open(search, model, found))
    search.screens[model.names] = found
    return found


def _open(search: Search, model: Model, found: Screen) -> float:
    """The evidence of what stands out with the noise's colour open [nats]; one that is enough ends
    the search.
    """
    names = found.stands_out[:WEIGHED]
    families = [f for f in search.scans if f.name in names]
    searched = scans.candidates(families, search.problem, model.fitted)
    peaks = {s.name: s for s in reversed(searched)}
    chosen = [
        found.best[n].signature if n in found.best else peaks[n]
        for n in names
        if n in found.best or n in peaks
    ]
    if not chosen:
        return np.inf
    weighed, most = OpenNoise(search.problem, model.fitted, chosen), -np.inf
    for number in range(len(chosen)):
        most = max(most, weighed.gain(number))
        if most > SURE:
            break
    return most


def _beside(search: Search, model: Model) -> Iterator[Signature]:
    """Signatures about the model's fit: of all shapes at the first screen, later of those that were
    likeliest there.
    """
    stack, fitted = search.problem.stack, model.fitted
    first = search.screens.get(())
    for name, effect in stack.rig.effects.items():
        if name in model.names:
            continue
        shapes = (
            list(shape_grid(stack.rig, effect))
            if first is None
            else first.shapes.get(name, [])[:AGAIN]
        )
        prior = -np.log(max(len(shapes), 1))
        for shape in _worth(search, model, effect, shapes):
            made = signature(stack, fitted.u, fitted.predicted, effect, shape, fitted.acting)
            if made is not None:
                yield replace(made, prior=prior)


def _worth(
    search: Search, model: Model, effect: type[Effect], shapes: list[dict[str, float]]
) -> list[dict[str, float]]:
    """The shapes to simulate: of ripples only those that the residual holds, the others' evidence
    being nil.
    """
    order = order_of(effect)
    if order is None or len(shapes) <= LOUDEST:
        return shapes
    problem = search.problem
    loud = loudest(
        problem.stack, problem.noise, model.fitted.residual, sorted({s[order] for s in shapes})
    )
    return [s for s in shapes if s[order] in loud]


def _resized(strain: Array, base: Base) -> Array:
    """Strains of the surrogates for a base of another number of unknowns."""
    size = base.jacobian.shape[1]
    if size <= strain.shape[0]:
        return strain[:size]
    more = np.random.default_rng(size).standard_normal((size - strain.shape[0], strain.shape[1]))
    return np.vstack((strain, more))


def likely(found: Screen, names: Sequence[str], most: int) -> list[str]:
    """Listed effects within reach of the best, most likely first."""
    listed = sorted((n for n in found.evidence if n in names), key=lambda n: -found.evidence[n])
    if not listed:
        return []
    top = max(found.evidence[listed[0]], 0.0)
    return [n for n in listed if found.evidence[n] >= min(REACH * top, top - 6.0)][:most]


def extend(search: Search, model: Model, found: Screen, most: int) -> list[Model]:
    """Fits of the model with one more effect each; those that may win are fitted to the end."""
    effects = search.problem.stack.rig.effects
    names = [n for n in likely(found, list(effects), most) if not search.has((*model.names, n))]
    made = each(
        search.jobs, lambda name: _fitted(search, model, effects[name], found.best[name]), names
    )
    if made:
        top = max(max(m.evidence for m in made), search.best().evidence)
        behind = _hopeless(search, top)
        foreseen = max(found.evidence[m.names[-1]] for m in made) - behind
        close = [
            m for m in made if m.evidence > top - behind or found.evidence[m.names[-1]] > foreseen
        ]
        done = iter(each(search.jobs, lambda m: _finished(search.problem, m), close))
        made = [next(done) if m in close else m for m in made]
    search.models += made
    return made


def _hopeless(search: Search, top: float) -> float:
    """How far behind the best evidence a model may be and still win: rivals for a strong effect
    differ by much.
    """
    return max(HOPELESS, BEHIND * (top - search.models[0].evidence))


def _finished(problem: Problem, model: Model) -> Model:
    return replace(model, fitted=problem.refine(model.fitted, THOROUGH))


def _fitted(search: Search, model: Model, effect: type[Effect], best: Whitened) -> Model:
    """One more effect, started at its linear estimate."""
    a, b = model.fitted.base().projected(best.columns)
    amplitude = np.asarray(np.linalg.solve(a + 0.1 * np.eye(len(b)), b))
    amplitude = np.where(np.array(best.signature.sign) > 0, np.maximum(amplitude, 0.02), amplitude)
    more = free_of((effect,))
    x = np.concatenate((model.fitted.x, _start(more, effect, amplitude, best.signature.shape)))
    effects: tuple[Maker, ...] = (*model.fitted.effects, effect)
    free = (*model.fitted.free, *more)
    fitted = search.problem.descend(effects, free, model.fitted.u, x, QUICK)
    return Model(fitted, (*model.names, effect.name), model.log_prior + _one_more(search, model))


def _one_more(search: Search, model: Model) -> float:
    """Log prior of one more effect beside those of a model."""
    gained = model.fitted.log_evidence - search.models[0].fitted.log_evidence
    return PAIR_PRIOR - form(gained) if model.names else 0.0


def form(gained: float) -> float:
    """What the remainder of another published form may be worth [nats]."""
    return float(np.clip(FORM * gained, 0.0, FORM_MOST))


def _start(
    free: Sequence[Free], effect: type[Effect], amplitude: Array, shape: dict[str, float]
) -> Array:
    size = dict(zip((p.name for p in strengths(effect)), amplitude.tolist(), strict=True))
    values = []
    for f in free:
        p = f.parameter
        values.append(size[p.name] if p.name in size else (shape[p.name] - p.centre) / p.sigma)
    return np.asarray(np.clip(np.array(values), -20.0, 20.0))


def run(search: Search, first: Model, step: Callable[[str], None] = lambda _: None) -> None:
    """Forward steps from the base model while the screen alarms; each from the best few models of
    the step before.
    """
    step("screening every effect")
    search.models.append(first)
    found = rescreen(search, first)
    if not found.alarmed:
        return
    step("fitting the likely effects")
    extend(search, first, found, MOST)
    for size in range(1, STEPS):
        here = sorted((m for m in search.models if len(m.names) == size), key=lambda m: -m.evidence)
        best = search.best().evidence
        here = [m for m in here[:PAIRS] if m.evidence > best - _hopeless(search, best)]
        if not here:
            return
        for model in here:
            step(f"looking beside {' and '.join(model.names)}")
            found = rescreen(search, model)
            if found.alarmed:
                extend(search, model, found, SECOND)
        if not any(len(m.names) == size + 1 for m in search.models):
            return
        _retest(search)
        if len(search.best().names) <= size:
            return


def _retest(search: Search) -> None:
    """The best model with each of its effects left out, if that was not fitted yet."""
    best = search.best()
    for leave in best.names[:-1]:
        kept = tuple(n for n in best.names if n != leave)
        if kept and not search.has(kept):
            free = free_of([search.problem.stack.rig.effects[n] for n in kept])
            x = np.array([_at(best.fitted, f) for f in free])
            effects = tuple(search.problem.stack.rig.effects[n] for n in kept)
            fitted = search.problem.descend(effects, free, best.fitted.u, x)
            single = max((m for m in search.models if len(m.names) == 1), key=lambda m: m.evidence)
            prior = _one_more(search, single) * (len(kept) - 1)
            search.models.append(Model(fitted, kept, prior))


def _at(fitted: Fitted, wanted: Free) -> float:
    return float(next(x for f, x in zip(fitted.free, fitted.x, strict=True) if f == wanted))
