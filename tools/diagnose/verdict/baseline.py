"""What a rig does anyway: the listed effects that its reference campaign shows by itself.

No explanation is asked for of a reference, and what it does is a freedom of the fit
(fit/reference.py). But that freedom is linear about the equations, and habits are not: the forces
of a wheel that follow over 60 mm are no multiple of those that follow over 30 mm. What a straight
line leaves of them becomes a large discrepancy of form, which hides what is new. So the reference
is first searched as any campaign is, and the effects found act in both campaigns, with parameters
that both tell.

What the reference is likeliest to show, but does not tell from others by itself, acts in both too
where that explains both campaigns no worse than without it, or than what was accepted as new. So
does an accepted effect that explains them no worse in both: the reference shows it, and was only
too short or too steady to tell it alone.

An effect that goes with time, heat, place or run may be another one a day later, but for one that
begins anew in every run, and a ripple has another phase in each run: those stay with the terms
of fit/shared.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

from gritd.estimator.config.settings import ConfiguredEffect, Uncertain
from gritd.estimator.effects.base import Effect
from gritd.tools.diagnose.fit.attempt import attempted
from gritd.tools.diagnose.fit.base import BaseFit
from gritd.tools.diagnose.fit.functions import BEYOND_FORM
from gritd.tools.diagnose.fit.model import Model, fit_model
from gritd.tools.diagnose.fit.problem import Fitted
from gritd.tools.diagnose.rig.interface import HAD, Rig
from gritd.tools.diagnose.search.search import TURNING
from gritd.tools.diagnose.verdict.decision import Decision

PASSING = {*BEYOND_FORM, TURNING}


def baseline_effects(rig: Rig, decision: Decision) -> tuple[ConfiguredEffect, ...]:
    """The lasting effects that are accepted of a reference alone, at their fitted values, each with
    the sigma of an effect of which nothing is known: both campaigns will tell it anew.

    Only those in whose place no other could stand. A name that its own campaign does not tell from
    others, as steady states often do not, would predict the new campaign by the wrong one.
    """
    model = decision.best
    sure = [name for name in model.names if not decision.groups[name]]
    lasting = [n for n in sure if _lasts(rig.effects[n])]
    return tuple(ConfiguredEffect(name, dict(_parameters(model, name))) for name in lasting)


def no_news(
    base: BaseFit, accepted: Model, of_reference: Decision | None
) -> tuple[ConfiguredEffect, ...]:
    """Effects that explain both campaigns, acting in both, no worse than a model explains them:
    what the reference is likeliest to show but does not tell from others, or an effect that was
    accepted as new. The likeliest of these as fitted; none where there is none.

    base: without what is new; accepted: the base model, or one with what was accepted.
    """
    rig = base.problem.stack.rig
    had = {constant.parameter[0] for constant in rig.constants if constant.kind == HAD}
    tried = [_InBoth(accepted.fitted, (name,)) for name in accepted.names]
    shown = [w for w in of_reference.weighed if w.names] if of_reference else []
    if shown:
        likeliest = max(shown, key=lambda w: w.probability)
        tried.append(_InBoth(likeliest.model.fitted, likeliest.names))

    found: list[tuple[tuple[str, ...], Model]] = []
    for one in tried:
        if of_reference and all(_lasts(rig.effects[n]) and n not in had for n in one.names):
            made = attempted(partial(_shared, base, one))
            found += [(one.names, made)] if made is not None else []
    names, best = max(found, key=lambda one: one[1].evidence, default=((), accepted))
    if best.evidence < accepted.evidence:
        return ()
    return tuple(ConfiguredEffect(name, dict(_parameters(best, name))) for name in names)


@dataclass(frozen=True, eq=False)
class _InBoth:
    """A fit whose effects are tried, those of some names in both campaigns."""

    fitted: Fitted
    names: tuple[str, ...]


def _shared(base: BaseFit, tried: _InBoth) -> Model:
    problem = base.problem.in_both(tried.names)
    begins = (base.fitted.u, tried.fitted.x)
    effects, free = tried.fitted.effects, tried.fitted.free
    return fit_model(problem, base.forms, effects, free, begins, base.model.sizes)


def _lasts(effect: type[Effect]) -> bool:
    return effect.every_run or effect.fingerprint.covariate not in PASSING


def _parameters(model: Model, name: str) -> Iterator[tuple[str, Uncertain]]:
    for free, x in zip(model.fitted.free, model.fitted.x, strict=True):
        if free.name == name:
            sigma = free.parameter.sigma / free.weight
            yield free.parameter.name, Uncertain(free.value(float(x)), sigma)
