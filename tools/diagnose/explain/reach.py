"""How far the parameters of an effect may be from where they were fitted.

The σ of a fit is that of a straight valley. Where a strength and the shapes of an effect make up
for each other the valley is bent, and its floor may be flat far beyond that σ: an angle shows in a
side force as its tangent times a share that is hardly known. So each strength is moved by two of
its σ, and all else with it as straight lines would have it. If the fit then loses what such lines
foretell, they hold. If not, the strength is held farther and farther off, and all else is fitted
again: two σ reach to where the evidence has fallen by as much as it would at two σ of a straight
valley (Bates and Watts 1988, Nonlinear Regression Analysis and Its Applications, ch. 6).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.attempt import attempted
from gritd.tools.diagnose.fit.model import Model, fit_model
from gritd.tools.diagnose.fit.problem import Fitted, Free, Problem
from gritd.tools.diagnose.search.models import EffectSearch
from gritd.tools.diagnose.tuning import TUNING


def reached(search: EffectSearch, model: Model, name: str) -> Array:
    """Half of how far each parameter of a model (p,), in expected sizes, may be from its mean as
    the strengths of one of its effects move; 0 where straight lines hold.
    """
    fitted, by = model.fitted, TUNING.numerics.reach
    mean, sigma = model.parameters()
    own = [
        n for n, f in enumerate(fitted.free) if f.name == name and f.parameter.role == "strength"
    ]
    own = [number for number in own if not fitted.held[fitted.u.size + number]]
    most = np.zeros_like(mean)
    for number in _bent(search.problem, fitted, own):
        for step in (-by * float(sigma[number]), by * float(sigma[number])):
            for x in _profile(search, model, number, step):
                most = np.maximum(most, np.abs(x - mean))
    return most / by


def _bent(problem: Problem, fitted: Fitted, numbers: Sequence[int]) -> Iterator[int]:
    """Of some parameters those of which a fit does not lose about what straight lines foretell
    where one is moved either way, and all else with it.
    """
    terms, sizes = zip(*fitted.nuisance.parts, strict=True)
    ground = problem.with_terms(terms[1:], sizes[1:]).ground(fitted.effects, fitted.free)
    covariance, centre = fitted.covariance(), fitted.centre
    for number in numbers:
        along = covariance[: centre.size, fitted.u.size + number]
        step = TUNING.numerics.reach * along / np.sqrt(along[fitted.u.size + number])
        for way in (step, -step):
            moved = ground.bounds.clipped(centre + way) - centre
            foretold = fitted.gradient @ moved + 0.5 * moved @ fitted.curvature @ moved
            lost = ground.tried(centre + moved)[1] - fitted.nats
            if not abs(lost - foretold) < 0.5 * _lost():
                yield number
                break


def _profile(search: EffectSearch, model: Model, number: int, step: float) -> Iterator[Array]:
    """Parameters (p,) of fits in which one is held farther and farther off its mean, each time
    twice as far, until the evidence has fallen as it does at so many σ of a straight valley; last
    where it has, by a straight line from the one before.
    """
    own, at = model.fitted.free[number].parameter, float(model.fitted.x[number])
    ends = sorted((end - own.centre) / own.sigma for end in (own.low, own.high))
    here = begins = _held(search, model, model.fitted, number, at)
    fallen, most = 0.0, float(np.sqrt(_lost()))
    for _ in range(TUNING.numerics.halvings):
        if here is None or begins is None:
            return
        there = _held(search, model, here.fitted, number, min(max(at + step, ends[0]), ends[1]))
        if there is None or there.fitted.x[number] == here.fitted.x[number]:
            return
        below = float(np.sqrt(max(begins.evidence - there.evidence, 0.0)))
        if below > most:
            share = (most - fallen) / (below - fallen)
            yield here.fitted.x + share * (there.fitted.x - here.fitted.x)
            return
        yield there.fitted.x
        here, fallen, step = there, below, 2.0 * step


def _held(search: EffectSearch, model: Model, near: Fitted, number: int, at: float) -> Model | None:
    """The model with one of its effects' parameters held; the rest as near by."""
    free = list(model.fitted.free)
    free[number] = _fixed(free[number], at)
    x = near.x.copy()
    x[number] = at
    forms = search.screening.forms
    begins, sizes = (near.u, x), model.sizes
    return attempted(
        lambda: fit_model(
            search.problem, forms, near.effects, tuple(free), begins, sizes, model.other_forms, near
        )
    )


def _lost() -> float:
    """What a move by so many σ loses where the valley is straight [nats]."""
    return 0.5 * TUNING.numerics.reach**2


def _fixed(free: Free, at: float) -> Free:
    p = free.parameter
    value = p.centre + at * p.sigma
    return replace(free, parameter=replace(p, low=value, high=value))
