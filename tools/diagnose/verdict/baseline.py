"""What a rig does anyway: the listed effects that its reference campaign shows by itself.

No explanation is asked for of a reference, and what it does is a freedom of the fit
(fit/reference.py). But that freedom is linear about the equations, and habits are not: the forces
of a wheel that follow over 60 mm are no multiple of those that follow over 30 mm. What a straight
line leaves of them becomes a large discrepancy of form, which hides what is new. So the reference
is first searched as any campaign is, and the effects found act in both campaigns, with parameters
that both tell.

What explains the reference with the largest evidence, but is not told from others there or only
resembles what is there, acts in both too where both campaigns are no less likely with it. So does
an effect accepted as new that explains them no worse in both: the reference shows it, and was only
too short or too steady to tell it alone.

An effect that goes with time, heat, place or run may be another one a day later, what a run begins
with is another in each, and a ripple has another phase in each: those stay with the terms of
fit/shared.py.
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
from gritd.tools.diagnose.fit.problem import Fitted
from gritd.tools.diagnose.rig.interface import HAD, Rig
from gritd.tools.diagnose.search.foretold import TURNING
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
    return _configured(model, lasting)


def shown_unsurely(base: BaseFit, of_reference: Decision | None) -> tuple[ConfiguredEffect, ...]:
    """The lasting effects of the explanation of a reference with the largest evidence, whether they
    are there or resembled, if both campaigns are no less likely with them; as fitted to both.
    of_reference: None where there is none.
    """
    named = [w for w in of_reference.weighed if w.names] if of_reference else []
    largest = max(named, key=lambda w: w.evidence, default=None)
    names = _not_had(base, largest.names) if largest is not None else []
    if largest is None or not names:
        return ()
    without = _in_both(base, base.model, (), ())
    found = _in_both(base, largest.model, names, names)
    if found is None or without is None:
        return ()
    return _configured(found, names) if found.evidence >= without.evidence else ()


def shown_as_well(base: BaseFit, accepted: Model) -> tuple[ConfiguredEffect, ...]:
    """An effect that was accepted as new, if it explains both campaigns no worse in both; as fitted
    to both. The likeliest of several.
    """
    if not base.problem.stack.referred:
        return ()
    tried = [
        (_in_both(base, accepted, accepted.names, (name,), accepted.fitted), name)
        for name in _not_had(base, accepted.names)
    ]
    found = [(model, name) for model, name in tried if model is not None]
    best, name = max(found, key=lambda one: one[0].evidence, default=(accepted, ""))
    return _configured(best, (name,)) if name and best.evidence >= accepted.evidence else ()


def _not_had(base: BaseFit, names: Sequence[str]) -> list[str]:
    """Those that last, and that both campaigns do not have already."""
    rig = base.problem.stack.rig
    had = {constant.parameter[0] for constant in rig.constants if constant.kind == HAD}
    return [name for name in names if _lasts(rig.effects[name]) and name not in had]


def _in_both(
    base: BaseFit,
    of: Model,
    acting: Sequence[str],
    both: Sequence[str],
    near: Fitted | None = None,
) -> Model | None:
    """Some effects of a model fitted, of these some in both campaigns; near: a fit to both, where
    the constants begin, if not at those of the base.
    """
    problem = base.problem.in_both(both)
    effects = tuple(e for e, n in zip(of.fitted.effects, of.names, strict=True) if n in acting)
    kept = np.array([free.name in acting for free in of.fitted.free], bool)
    free = tuple(f for f, keep in zip(of.fitted.free, kept, strict=True) if keep)
    begins, sizes = ((near or base.fitted).u, of.fitted.x[kept]), base.model.sizes
    return attempted(
        lambda: fit_model(problem, base.forms, effects, free, begins, sizes, near=near)
    )


def _configured(model: Model, names: Sequence[str]) -> tuple[ConfiguredEffect, ...]:
    return tuple(ConfiguredEffect(name, dict(_parameters(model, name))) for name in names)


def _lasts(effect: type[Effect]) -> bool:
    """Whether an effect of one campaign is the same in another; of those that begin anew in every
    run what is of the drive, for a wheel is set down another way each time.
    """
    drives = effect.every_run and effect.stage == "drivetrain"
    return drives or effect.fingerprint.covariate not in PASSING


def _parameters(model: Model, name: str) -> Iterator[tuple[str, Uncertain]]:
    for free, x in zip(model.fitted.free, model.fitted.x, strict=True):
        if free.name == name:
            sigma = free.parameter.sigma / free.weight
            yield free.parameter.name, Uncertain(free.value(float(x)), sigma)
