"""What a rig does anyway: the listed effects that its reference campaign shows by itself.

No explanation is asked for of a reference, and what it does is a freedom of the fit
(fit/reference.py). But that freedom is linear about the equations, and habits are not: the forces
of a wheel that follow over 60 mm are no multiple of those that follow over 30 mm. What a straight
line leaves of them becomes a large discrepancy of form, which hides what is new. So the reference
is first searched as any campaign is, and the effects found act in both campaigns, with parameters
that both tell.

An effect that goes with time, heat, place or run may be another one a day later, but for one that
begins anew in every run, and a ripple has another phase in each run: those stay with the terms
of fit/shared.py.
"""

from __future__ import annotations

from collections.abc import Iterator

from gritd.estimator.config.settings import ConfiguredEffect, Uncertain
from gritd.estimator.effects.base import Effect
from gritd.tools.diagnose.fit.functions import BEYOND_FORM
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.rig.interface import Rig
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


def _lasts(effect: type[Effect]) -> bool:
    return effect.every_run or effect.fingerprint.covariate not in PASSING


def _parameters(model: Model, name: str) -> Iterator[tuple[str, Uncertain]]:
    for free, x in zip(model.fitted.free, model.fitted.x, strict=True):
        if free.name == name:
            sigma = free.parameter.sigma / free.weight
            yield free.parameter.name, Uncertain(free.value(float(x)), sigma)
