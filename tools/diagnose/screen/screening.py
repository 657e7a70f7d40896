"""What is looked for beside a fitted model: listed effects, smooth functions, waves and steps."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain

import numpy as np

from gritd.estimator.effects.base import Effect, order_of
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.parallel import each
from gritd.tools.diagnose.fit.base import BaseFit
from gritd.tools.diagnose.fit.evidence import Signature
from gritd.tools.diagnose.fit.freedom import Freedom
from gritd.tools.diagnose.fit.functions import BEYOND_FORM, smooth_signatures
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.fit.projection import Surrogates
from gritd.tools.diagnose.fit.shape import Candidate, Shape
from gritd.tools.diagnose.fit.signatures import shape_grid, signature, some_of
from gritd.tools.diagnose.noise.colour import surrogates, whiten
from gritd.tools.diagnose.rig.interface import HAD
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.screen.covered import covered_share
from gritd.tools.diagnose.screen.habit import habits
from gritd.tools.diagnose.screen.open_colour import OpenNoise
from gritd.tools.diagnose.screen.open_form import gain_with_form_open
from gritd.tools.diagnose.screen.ripples import loudest
from gritd.tools.diagnose.screen.scans import Family, candidates, families, without_harmonics
from gritd.tools.diagnose.screen.screen import (
    Part,
    Screen,
    WhitenedSignature,
    screen_signatures,
    tail_chance,
    whitened,
)
from gritd.tools.diagnose.tuning import TUNING


@dataclass(frozen=True)
class Screening:
    """All that may be amiss beside the effects, and what noise alone would show of it."""

    problem: Problem
    base: Model
    forms: tuple[Freedom, ...]  # what the form of the model may be off by
    functions: tuple[Signature, ...]  # smooth functions without a name
    families: tuple[Family, ...]  # waves and steps without a name
    surrogates: Surrogates

    def shapes(self, model: Model) -> list[Signature]:
        """What the form of the model cannot be: smooth functions of time and place, and the
        likeliest waves and steps beside a model.
        """
        formed = {channel for source in self.problem.stack.rig.forms for channel in source.channels}
        beyond = [
            s
            for s in self.functions
            if s.shape.channel not in formed or set(s.shape.along) <= BEYOND_FORM
        ]
        return [*beyond, *candidates(self.families, self.problem, model.fitted)]


def prepare_screening(base: BaseFit, rng: np.random.Generator) -> Screening:
    """Everything that screens of any model share."""
    noise, unknowns = base.problem.noise, base.fitted.penalty.size
    residuals = whiten(noise, surrogates(noise, TUNING.screen.nulls, rng))
    drawn = Surrogates(residuals, rng.standard_normal((unknowns, TUNING.screen.nulls)))

    stack = base.problem.stack
    return Screening(
        base.problem,
        base.model,
        base.forms,
        smooth_signatures(stack),
        families(stack, noise),
        drawn,
    )


def screen_of_base(screening: Screening, jobs: int = 1) -> Screen:
    """Evidence for an effect, and for a misfit without a name, beside the base model.

    jobs: processes.
    """
    problem, model, drawn = screening.problem, screening.base, screening.surrogates
    if problem.stack.referred:
        screen = _screen_beside_reference(screening, model)
        counts = max(_covered(screening), TUNING.screen.least_covered)
        open_ = counts * _open_form(screening, model, screen)
        ripple = _ripple(problem) ** counts  # as evidence, it counts by the covered share
        strain = strain_of(problem, model)
        return replace(screen, open=open_, ripple=ripple, counts=counts, strain=strain)
    searched = _averages(screening, model, jobs)
    projection = model.fitted.projection(drawn)
    kept = screening.functions
    screen = screen_signatures(projection, _parts(screening, model), searched, jobs, kept)

    # whether there is a mismatch at all; with a reference campaign the noise's colour is not open
    open_ = np.inf if problem.stack.rig.tabled else _open(screening, model, screen, jobs)
    return replace(screen, open=open_, ripple=_ripple(problem), strain=strain_of(problem, model))


def strain_of(problem: Problem, model: Model) -> float:
    """How far the farthest constant of a fit stands from what is known of it [σ]; beside a
    reference, of those that tell what is new.
    """
    referred = problem.stack.referred
    told = [bool(constant.changes) or not referred for constant in problem.stack.rig.constants]
    return float(np.max(np.abs(model.fitted.u[np.array(told, bool)]), initial=0.0))


def with_form_open(screening: Screening, bare: Model, screen: Screen) -> Screen:
    """A screen without a reference, where the configuration holds a learnt discrepancy: this rig is
    known to be off the equations, so what is new must be more than a further discrepancy of any
    size, the more so where it was not learnt. bare: the model without effects with that.
    """
    held = screening.problem.stack.rig.held
    if held is None or screening.problem.stack.referred or not screen.on_grid:
        return screen
    counts = max(held.covered, TUNING.screen.least_covered)
    left = counts * _open_form(screening, bare, screen)
    most = max(screen.asked, asked(screening.problem.stack))
    least, strain = min(screen.open, left), strain_of(screening.problem, bare)
    return replace(screen, open=least, counts=counts, asked=most, strain=strain)


def _parts(screening: Screening, model: Model) -> list[Part]:
    """Everything that is tried but waves and steps, some effects at a time."""
    problem = screening.problem

    def effects(names: Sequence[str]) -> Iterator[WhitenedSignature]:
        with problem.stack.rig.aside():  # the same bits, whatever was tried before
            yield from whitened(problem.noise, _signatures(problem, model, names))

    def others() -> Iterator[WhitenedSignature]:
        return whitened(problem.noise, chain(screening.functions, _strains(problem, model)))

    return [*(partial(effects, names) for names in some_of(problem.stack.rig.effects)), others]


def _averages(screening: Screening, model: Model, jobs: int) -> dict[Shape, Array]:
    """Log Bayes factor (1 + draws,) of every family of waves or steps beside a model."""
    beside = without_harmonics(screening.problem, model.fitted, screening.surrogates)
    every = each(jobs, lambda family: family.average(beside), screening.families)
    return {family.shape: mean for family, mean in zip(screening.families, every, strict=True)}


def _ripple(problem: Problem) -> float:
    """Chance of the likeliest new ripple of the wheel at full rate."""
    return min((line.p for line in problem.stack.rig.lines.fresh()), default=1.0)


def _screen_beside_reference(screening: Screening, model: Model) -> Screen:
    """Beside the model of both campaigns: every candidate in the new one, and in each run of the
    reference; waves and steps in all of its runs.
    """
    problem, stack = screening.problem, screening.problem.stack
    projection = model.fitted.projection(screening.surrogates)
    effects = _signatures(problem, model, problem.stack.rig.effects, everywhere=True)
    smooth = smooth_signatures(stack, everywhere=True)
    both = list(whitened(problem.noise, chain(effects, smooth)))

    alone = projection.of_rows(~stack.new)  # what is new must not tell what is usual
    usual = habits(alone, both, stack)

    for s in both:  # in their place: together they are large
        s.signature.columns[~stack.new] = 0.0
        s.columns[~stack.new] = 0.0
    beside = without_harmonics(problem, model.fitted, screening.surrogates)
    searched = {family.shape: family.average(beside) for family in screening.families}
    screen = screen_signatures(projection, [lambda: both], searched)

    of_reference = families(stack, problem.noise, ~stack.new)
    rest = beside.of_rows(~stack.new)
    shapes: dict[Candidate, float] = {f.shape: float(f.average(rest)[0]) for f in of_reference}
    ripples = {name for name, effect in stack.rig.effects.items() if order_of(effect)}
    return screen.beside_reference({**shapes, **usual}, asked(stack), ripples)


def asked(stack: Stack) -> float:
    """Evidence that must be left beside what the rig does anyway [nats]: where that has transients,
    whose law is never quite the rig's, as much as of campaigns alone.
    """
    shown = {c.parameter[0] for c in stack.rig.constants if c.kind == HAD}
    had = [effect for name, effect in stack.rig.effects.items() if name in shown]
    kinds = [*had, *(type(effect) for effect in stack.rig.baseline)]
    passing = any(effect.in_steady_states() is None for effect in kinds)
    return TUNING.screen.sure if passing else TUNING.screen.beside_reference


def chance_of(
    screening: Screening, model: Model, searched: Collection[Shape]
) -> dict[Shape, float]:
    """Chance by noise alone of the evidence that families of waves or steps have beside a model."""
    beside = without_harmonics(screening.problem, model.fitted, screening.surrogates)
    averages = {f.shape: f.average(beside) for f in screening.families if f.shape in searched}
    return {shape: tail_chance(mean[1:], float(mean[0])) for shape, mean in averages.items()}


def _signatures(
    problem: Problem, model: Model, names: Iterable[str], everywhere: bool = False
) -> Iterator[Signature]:
    """Signatures of some effects about the model's fit; everywhere: in the reference campaign
    too.
    """
    stack, fitted = problem.stack, model.fitted

    for effect in (stack.rig.effects[name] for name in names):
        tried = list(shape_grid(stack.rig, effect))
        prior = -np.log(max(len(tried), 1))
        for fixed in _worth(problem, model, effect, tried):
            made = signature(
                stack, fitted.u, fitted.predicted, effect, fixed, fitted.acting, everywhere
            )
            if made is not None:
                yield replace(made, prior=prior)


def _worth(
    problem: Problem, model: Model, effect: type[Effect], tried: list[dict[str, float]]
) -> list[dict[str, float]]:
    """What to simulate: of ripples only those that the residual holds, the others' evidence being
    nil.
    """
    order = order_of(effect)
    if order is None or len(tried) <= TUNING.screen.loudest:
        return tried

    orders = sorted({fixed[order] for fixed in tried})
    loud = loudest(problem.stack, problem.noise, model.fitted.residual, orders)
    return [fixed for fixed in tried if fixed[order] in loud]


def _strains(problem: Problem, model: Model) -> Iterator[Signature]:
    """Every constant off by more than is known of it: a misfit that it takes is said."""
    for number, constant in enumerate(problem.stack.rig.constants):
        columns = TUNING.screen.strained * model.fitted.raw[:, number : number + 1]
        if np.any(columns):
            shape = Shape(constant.name, (constant.name,), "strain")
            yield Signature(shape, columns, (0,), {})


def _open(screening: Screening, model: Model, screen: Screen, jobs: int = 1) -> float:
    """The evidence of what stands out with the noise's colour open [nats]; one that is enough ends
    the search. What surprises most with one colour need not be what slow noise cannot be, so all
    are weighed.

    jobs: processes.
    """
    chosen = _standing_out(screening, model, screen)
    if not chosen:
        return np.inf

    most = -np.inf
    for some in some_of(chosen):
        weighed = OpenNoise(screening.problem, model.fitted, some, jobs)
        for number in range(len(some)):
            most = max(most, weighed.gain(number))
            if most > TUNING.screen.sure:
                return most
    return most


def _open_form(screening: Screening, model: Model, screen: Screen) -> float:
    """The evidence of what is new with the sizes of what the rig does anyway open [nats]."""
    if not screen.stands_out:
        return np.inf
    every = [*screen.best.values(), *_peaks(screening, model, screen).values()]
    return gain_with_form_open(screening.problem, model, every)


def _covered(screening: Screening) -> float:
    """Share of the new campaign that the reference covers; all where no form varies."""
    stack = screening.problem.stack
    return covered_share(stack) if stack.rig.forms else 1.0


def _standing_out(screening: Screening, model: Model, screen: Screen) -> list[Signature]:
    """The candidates that stand out, the most surprising first, each as it is likeliest."""
    every = {**screen.best, **_peaks(screening, model, screen)}
    return [every[of] for of in screen.stands_out if of in every]


def _peaks(screening: Screening, model: Model, screen: Screen) -> dict[Candidate, Signature]:
    """Of the waves and steps that stand out each where it is likeliest."""
    outstanding = set(screen.stands_out)
    searched = [f for f in screening.families if f.shape in outstanding]
    peaks = candidates(searched, screening.problem, model.fitted)
    return {s.shape.family: s for s in reversed(peaks)}
