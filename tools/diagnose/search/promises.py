"""What each effect would gain beside a model by linear algebra, and where its fit begins.

A discrepancy of form that was learnt without an effect may have taken the effect's part. So each
effect is judged beside smaller discrepancies too, at what these cost. Beside a model without
effects it is also judged as it may vary along the bed. A fit is not linear, so it may do better
than linear algebra by a share.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from gritd.estimator.effects.base import Effect
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.parallel import each
from gritd.tools.diagnose.fit.attempt import attempted
from gritd.tools.diagnose.fit.bending import varied_along_place
from gritd.tools.diagnose.fit.evidence import Signature, log_bayes, log_evidence
from gritd.tools.diagnose.fit.marginal import Chosen
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.fit.settings import Settings, settings_of
from gritd.tools.diagnose.fit.signatures import signature, some_of, strengths
from gritd.tools.diagnose.noise.colour import whiten
from gritd.tools.diagnose.screen.screen import Screen
from gritd.tools.diagnose.tuning import TUNING

TURNING = "wheel_angle"  # what an effect that ripples goes with


@dataclass(frozen=True)
class Promise:
    """What an effect would gain beside a model by linear algebra [nats], where its fit begins, and
    the sizes of the forms beside which it gains that; others: where else the fit may begin.
    """

    gain: float
    effect: type[Effect]
    start: Array  # of its parameters, in their units
    sizes: Chosen
    others: tuple[Promise, ...] = ()


@dataclass(frozen=True)
class Beside:
    """A model beside which effects are judged, by what the screen kept of them."""

    problem: Problem
    screen: Screen
    model: Model
    settings: Settings


def promises(problem: Problem, screen: Screen, model: Model, jobs: int = 1) -> list[Promise]:
    """Of every effect that may be what raised the alarm and is not in the model, the most promising
    first.

    jobs: processes.
    """
    effects = problem.stack.rig.effects
    beside = Beside(problem, screen, model, settings_of(problem, model))
    names = [n for n in effects if n not in model.names and n in screen.fixed]
    if not screen.on_grid:  # a ripple alone raised the alarm
        names = [n for n in names if effects[n].fingerprint.covariate == TURNING]

    def likeliest(some: Sequence[str]) -> list[Promise]:
        with problem.stack.rig.aside():  # the same bits, whatever was tried before
            every = [attempted(partial(_promised, beside, effects[name])) for name in some]
            return [promise for promise in every if promise is not None]

    made = each(jobs, likeliest, list(some_of(names)))
    return sorted((one for some in made for one in some), key=lambda promise: -promise.gain)


def _promised(beside: Beside, effect: type[Effect]) -> Promise | None:
    """The best promise of an effect, less what a reference shows of it, with those at its other
    shapes; None without any.
    """
    ranked, screen = beside.screen.fixed[effect.name], beside.screen
    if beside.model.names:  # by the columns of the screen: one more effect hardly changes them
        first = _best_of(beside, effect, [screen.best[effect.name]])
    else:
        first = _best_of(beside, effect, _made(beside, effect, ranked[: TUNING.search.again]))
    if first is None:
        return None
    usual = TUNING.screen.habit * screen.habit.get(effect.name, 0.0)
    sharp = not beside.model.names and any(p.scan and p.unit == "m" for p in effect.parameters())
    elsewhere = _made(beside, effect, _apart(ranked)[: TUNING.search.elsewhere]) if sharp else ()
    others = (_best_of(beside, effect, [made]) for made in elsewhere)
    kept = [p for p in others if p is not None and p.gain > TUNING.search.promising]
    new = tuple(p for p in kept if not np.array_equal(p.start, first.start))
    return replace(first, gain=first.gain - usual, others=new)


def _made(
    beside: Beside, effect: type[Effect], shapes: Iterable[dict[str, float]]
) -> Iterator[Signature]:
    """An effect of some shapes about the model, where it changes anything."""
    fitted, stack = beside.model.fitted, beside.problem.stack
    for fixed in shapes:
        made = signature(stack, fitted.u, fitted.predicted, effect, fixed, fitted.acting)
        if made is not None:
            yield made


def _best_of(beside: Beside, effect: type[Effect], shapes: Iterable[Signature]) -> Promise | None:
    """The best promise of an effect of some shapes."""
    tried = (p for made in shapes for p in _tried(beside, effect, made))
    return max(tried, key=lambda p: np.round(p.gain / TUNING.search.same), default=None)


def _apart(ranked: Sequence[dict[str, float]]) -> list[dict[str, float]]:
    """Of shapes that were tried, the likeliest first, those that are not beside a likelier one in
    the grid.
    """
    grid = {name: sorted({fixed[name] for fixed in ranked}) for name in ranked[0]}
    places = [np.array([grid[name].index(fixed[name]) for name in grid]) for fixed in ranked]
    return [
        fixed
        for number, fixed in enumerate(ranked)
        if all(np.abs(places[number] - other).max() > 1 for other in places[:number])
    ]


def _tried(beside: Beside, effect: type[Effect], made: Signature) -> Iterator[Promise]:
    """The promise of an effect of some shape for each setting."""
    problem = beside.problem
    varied = [] if beside.model.names else varied_along_place(problem.stack, effect, made)
    count = len(made.sign)
    columns = whiten(problem.noise, np.column_stack((made.columns, *varied)))
    for sizes, cost, a, b in beside.settings.project(columns):
        own = log_evidence(a[:count, :count], b[:count], made.sign)
        amplitude = _amplitude(a[:count, :count], b[:count])
        yield _promise(effect, made, float(own), cost, amplitude, sizes)
        for bayes, amplitude in _gains_varied(made, a, b):
            yield _promise(effect, made, bayes, cost, amplitude, sizes)


def _gains_varied(made: Signature, a: Array, b: Array) -> Iterator[tuple[float, Array]]:
    """Log Bayes factor of an effect of which one strength varies along the bed, and the strengths
    (p,); of each strength. What varies about a mean that constants take tells the strength too.
    """
    count = len(made.sign)
    waves = (len(b) - count) // count
    for number in range(count if waves else 0):
        first = count + number * waves
        index = np.concatenate((np.arange(count), np.arange(first, first + waves)))
        own, right = a[np.ix_(index, index)], b[index]
        sign = (*made.sign, *(0,) * waves)
        amplitude = _amplitude(own, right)
        told = float(np.sqrt(np.mean(amplitude[count:] ** 2)))
        amplitude = amplitude[:count]
        amplitude[number] = np.copysign(max(abs(amplitude[number]), told), amplitude[number])
        yield float(log_bayes(own, right, sign)) + TUNING.search.varied, amplitude


def _promise(
    effect: type[Effect],
    made: Signature,
    bayes: float,
    cost: float,
    amplitude: Array,
    sizes: Chosen,
) -> Promise:
    gain = (1.0 + TUNING.search.curved) * bayes - cost
    return Promise(gain, effect, _start(effect, made, amplitude), sizes)


def _amplitude(a: Array, b: Array) -> Array:
    """Linear estimate of strengths (p,)."""
    return np.asarray(np.linalg.solve(a + TUNING.search.least_precision * np.eye(len(b)), b))


def _start(effect: type[Effect], made: Signature, amplitude: Array) -> Array:
    """Where the fit of an effect's parameters begins: strengths at their linear estimate (p,)."""
    amplitude = np.where(
        np.array(made.sign) > 0, np.maximum(amplitude, TUNING.search.least_start), amplitude
    )

    size = dict(zip((p.name for p in strengths(effect)), amplitude.tolist(), strict=True))
    values = [
        size[p.name] if p.name in size else (made.fixed[p.name] - p.centre) / p.sigma
        for p in effect.parameters()
    ]

    return np.asarray(
        np.clip(np.array(values), -TUNING.search.farthest_start, TUNING.search.farthest_start)
    )
