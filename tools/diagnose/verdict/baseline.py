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

from collections.abc import Iterator, Sequence
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


def shown_unsurely(base: BaseFit, of_reference: Decision | None) -> tuple[ConfiguredEffect, ...]:
    """What the reference is likeliest to show, if both campaigns are no less likely with it than
    without what is new; as fitted to both. of_reference: None where there is none.
    """
    shown = [w for w in of_reference.weighed if w.names] if of_reference else []
    if not shown:
        return ()
    likeliest = max(shown, key=lambda w: w.probability)
    return _in_both(base, base.model, [(likeliest.model.fitted, likeliest.names)])


def shown_as_well(base: BaseFit, accepted: Model) -> tuple[ConfiguredEffect, ...]:
    """An effect that was accepted as new, if it explains both campaigns no worse in both; as fitted
    to both. The likeliest of several.
    """
    if not base.problem.stack.referred:
        return ()
    return _in_both(base, accepted, [(accepted.fitted, (name,)) for name in accepted.names])


def _in_both(
    base: BaseFit, than: Model, tried: Sequence[tuple[Fitted, tuple[str, ...]]]
) -> tuple[ConfiguredEffect, ...]:
    """The likeliest of fits whose effects of some names act in both campaigns, if it is no less
    likely than a model.
    """
    rig = base.problem.stack.rig
    had = {constant.parameter[0] for constant in rig.constants if constant.kind == HAD}
    found: list[tuple[Model, tuple[str, ...]]] = []
    for fitted, names in tried:
        if all(_lasts(rig.effects[name]) and name not in had for name in names):
            model = attempted(partial(_shared, base, fitted, names))
            found += [(model, names)] if model is not None else []

    best, names = max(found, key=lambda one: one[0].evidence, default=(than, ()))
    if best.evidence < than.evidence:
        return ()
    return tuple(ConfiguredEffect(name, dict(_parameters(best, name))) for name in names)


def _shared(base: BaseFit, fitted: Fitted, names: Sequence[str]) -> Model:
    problem, begins = base.problem.in_both(names), (base.fitted.u, fitted.x)
    return fit_model(problem, base.forms, fitted.effects, fitted.free, begins, base.model.sizes)


def _lasts(effect: type[Effect]) -> bool:
    return effect.every_run or effect.fingerprint.covariate not in PASSING


def _parameters(model: Model, name: str) -> Iterator[tuple[str, Uncertain]]:
    for free, x in zip(model.fitted.free, model.fitted.x, strict=True):
        if free.name == name:
            sigma = free.parameter.sigma / free.weight
            yield free.parameter.name, Uncertain(free.value(float(x)), sigma)
