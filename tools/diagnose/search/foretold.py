"""What linear algebra foretells of models with one more effect, and where their fits begin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.tools.diagnose.fit.attempt import attempted
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.screen.evidence import (
    Pass,
    Weighed,
    pairs_beside,
    pass_beside,
    varied_pass,
)
from gritd.tools.diagnose.search.models import EffectSearch
from gritd.tools.diagnose.tuning import TUNING

TURNING = "wheel_angle"  # what an effect that ripples goes with


@dataclass(frozen=True)
class Predicted:
    """An effect beside a model: its log evidence by linear algebra, of the model with it [nats],
    and where its fit begins.
    """

    model: Model
    evidence: float
    starts: tuple[Weighed, ...]

    @property
    def effect(self) -> str:
        of = self.starts[0].signature.of
        assert isinstance(of, str)
        return of

    @property
    def names(self) -> frozenset[str]:
        return frozenset((*self.model.names, self.effect))


def gains(search: EffectSearch, model: Model, jobs: int) -> list[Predicted]:
    """Effects that gain enough beside a model: a share of the best, which a fit may turn round."""
    first = search.first.effects
    if model is search.bare:
        beside = varied_pass(search.problem, model, first, jobs)
    else:
        beside = pass_beside(search.problem, model, first)

    names = list(beside.effects)
    if not search.first.on_grid:  # a ripple alone raised the alarm
        effects = search.problem.stack.rig.effects
        names = [n for n in names if effects[n].fingerprint.covariate == TURNING]
    top = max((beside.gain(name) for name in names), default=0.0)
    alone = TUNING.search.little if model.names else 0.0
    least = max(alone, TUNING.search.predicted_share * top - TUNING.search.predicted_less)
    likely = [name for name in names if beside.gain(name) > least]
    return [
        Predicted(model, model.evidence + beside.gain(n), _starts(search, model, beside, n))
        for n in likely
    ]


def together(search: EffectSearch) -> list[Predicted]:
    """The likeliest pairs of effects beside the bare model, where one of them was fitted alone: the
    likelier one, beside which the other begins.
    """
    bare, first = search.bare, search.first.effects
    if len(first.effects) < 2 or not search.first.on_grid:
        return []
    most = TUNING.search.together
    alone, out = {model.names[0]: model for model in search.sized(1)}, []
    for pair in attempted(lambda: pairs_beside(search.problem, bare, first, most)) or []:
        fitted = [alone[name] for one in pair.each if (name := str(one.signature.of)) in alone]
        if fitted:
            model = max(fitted, key=lambda m: m.evidence)
            other = next(one for one in pair.each if one.signature.of not in model.names)
            sizes = (*other.sizes, *(0 for _ in model.chosen[len(bare.chosen) :]))
            out.append(Predicted(model, pair.evidence, (replace(other, sizes=sizes),)))
    return out


def _starts(search: EffectSearch, model: Model, beside: Pass, name: str) -> tuple[Weighed, ...]:
    """The likeliest shape of an effect; beside the bare model of one with edges along the bed also
    others, elsewhere.
    """
    every = beside.effects[name]
    edges = any(
        p.scan and p.unit == "m" for p in search.problem.stack.rig.effects[name].parameters()
    )
    if model.names or not edges:
        return tuple(every[:1])
    apart = _apart(every)[: TUNING.search.again]
    return tuple(one for one in apart if one.evidence > beside.alone) or tuple(every[:1])


def _apart(ranked: Sequence[Weighed]) -> list[Weighed]:
    """Of shapes that were tried, the likeliest first, those that are not beside a likelier one in
    the grid.
    """
    tried = [one.signature.fixed for one in ranked]
    grid = {name: sorted({fixed[name] for fixed in tried}) for name in tried[0]}
    places = [np.array([grid[name].index(fixed[name]) for name in grid]) for fixed in tried]
    return [
        one
        for number, one in enumerate(ranked)
        if all(np.abs(places[number] - other).max() > 1 for other in places[:number])
    ]
