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

import numpy as np

from gritd.estimator.config.settings import ConfiguredEffect, Uncertain
from gritd.estimator.effects.base import Effect
from gritd.tools.diagnose.fit.attempt import attempted
from gritd.tools.diagnose.fit.base import BaseFit
from gritd.tools.diagnose.fit.functions import BEYOND_FORM
from gritd.tools.diagnose.fit.model import Model, fit_model
from gritd.tools.diagnose.rig.interface import HAD, Rig
from gritd.tools.diagnose.search.calibration import learnt
from gritd.tools.diagnose.search.search import TURNING
from gritd.tools.diagnose.verdict.decision import Decision
from gritd.tools.diagnose.verdict.resemblance import likely

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
    return _configured(model, lasting)


def shown_unsurely(base: BaseFit, of_reference: Decision | None) -> tuple[ConfiguredEffect, ...]:
    """What the reference is likeliest to show, where that is likelier to be there than to be
    resembled, if both campaigns are likelier with it; as fitted to both. of_reference: None where
    there is none.
    """
    named = [w for w in of_reference.weighed if w.names] if of_reference else []
    likeliest = max(named, key=lambda w: w.probability, default=None)
    if likeliest is None or not all(likely(trust) for trust in likeliest.trusts.values()):
        return ()
    found = _in_both(base, likeliest.model, likeliest.names)
    without = _in_both(base, base.model, ()) if found else None
    if found is None or without is None:
        return ()
    gain, count = np.array([found.evidence - without.evidence]), np.array([len(likeliest.names)])
    by = learnt(len(base.problem.stack.rig.effects), referred=True)
    likelier = by.weights(gain, count, np.zeros(1))[0] > 0.0
    return _configured(found, likeliest.names) if likelier else ()


def shown_as_well(base: BaseFit, accepted: Model) -> tuple[ConfiguredEffect, ...]:
    """An effect that was accepted as new, if it explains both campaigns no worse in both; as fitted
    to both. The likeliest of several.
    """
    if not base.problem.stack.referred:
        return ()
    tried = [(_in_both(base, accepted, (name,)), name) for name in accepted.names]
    found = [(model, name) for model, name in tried if model is not None]
    best, name = max(found, key=lambda one: one[0].evidence, default=(accepted, ""))
    return _configured(best, (name,)) if name and best.evidence >= accepted.evidence else ()


def _in_both(base: BaseFit, of: Model, names: Sequence[str]) -> Model | None:
    """A model's effects fitted, those of some names in both campaigns; None where one of these does
    not last, or both have it already.
    """
    rig, fitted = base.problem.stack.rig, of.fitted
    had = {constant.parameter[0] for constant in rig.constants if constant.kind == HAD}
    if not all(_lasts(rig.effects[name]) and name not in had for name in names):
        return None
    problem, begins = base.problem.in_both(names), (base.fitted.u, fitted.x)
    effects, free, sizes = fitted.effects, fitted.free, base.model.sizes
    return attempted(lambda: fit_model(problem, base.forms, effects, free, begins, sizes))


def _configured(model: Model, names: Sequence[str]) -> tuple[ConfiguredEffect, ...]:
    return tuple(ConfiguredEffect(name, dict(_parameters(model, name))) for name in names)


def _lasts(effect: type[Effect]) -> bool:
    return effect.every_run or effect.fingerprint.covariate not in PASSING


def _parameters(model: Model, name: str) -> Iterator[tuple[str, Uncertain]]:
    for free, x in zip(model.fitted.free, model.fitted.x, strict=True):
        if free.name == name:
            sigma = free.parameter.sigma / free.weight
            yield free.parameter.name, Uncertain(free.value(float(x)), sigma)
