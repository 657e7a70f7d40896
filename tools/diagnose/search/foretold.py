"""What linear algebra foretells of models with one more effect, and where their fits begin."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gritd.tools.diagnose.fit.attempt import attempted
from gritd.tools.diagnose.fit.marginal import Marginal
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.screen.evidence import (
    Pass,
    Weighed,
    pairs_beside,
    pass_beside,
    varied_pass,
)
from gritd.tools.diagnose.screen.screening import Screening
from gritd.tools.diagnose.search.models import EffectSearch
from gritd.tools.diagnose.tuning import TUNING

TURNING = "wheel_angle"  # what an effect that ripples goes with


@dataclass(frozen=True)
class Predicted:
    """An effect beside a model: its log evidence by linear algebra, of the model with it [nats],
    and where its fit begins. stand: where linear algebra looked (`standing`).
    """

    model: Model
    evidence: float
    starts: tuple[Weighed, ...]
    stand: Model

    @property
    def effect(self) -> str:
        of = self.starts[0].signature.of
        assert isinstance(of, str)
        return of

    @property
    def names(self) -> frozenset[str]:
        return frozenset((*self.model.names, self.effect))


def standing(screening: Screening, model: Model) -> list[Model]:
    """Where linear algebra may look for more beside a model: where it was fitted. If what is
    missing strains constants there, the way to it may be straighter from the constants as they are
    known.
    """
    fitted, problem, marginal = model.fitted, screening.problem, model.marginal
    known = 0.0 * fitted.u if screening.usual is None else screening.usual
    if marginal is None or np.abs(fitted.u - known).max(initial=0.0) <= TUNING.rig.doubt:
        return [model]
    sizes = [term.sizes.values[n] for term, n in zip(marginal.terms, model.chosen, strict=True)]
    sized = problem.with_terms(marginal.terms, sizes)
    there = sized.descend(fitted.effects, fitted.free, known, fitted.x, rounds=0)
    marginal = Marginal(there, problem.fixed, marginal.terms)
    chosen, evidence = marginal.likeliest(model.chosen)
    of_form = chosen[: len(model.sizes)]
    return [model, Model(there, model.names, evidence, of_form, (), marginal, chosen)]


def passed(
    stands: Sequence[Model], look: Callable[[Model], Pass], first: Sequence[Pass] = ()
) -> tuple[Model, Pass]:
    """From where something is likeliest, and what is seen from there. first: passes that are known
    of the first places.
    """
    every = [*first, *(look(stand) for stand in stands[len(first) :])]
    return max(zip(stands, every, strict=True), key=lambda pair: pair[1].most)


def gains(search: EffectSearch, model: Model, jobs: int) -> list[Predicted]:
    """Effects that gain enough beside a model: a share of the best, which a fit may turn round."""
    if model is search.bare:
        stand = search.stand
        beside = varied_pass(search.problem, stand, search.passed, jobs)
    else:
        stands = standing(search.screening, model)
        stand, beside = passed(stands, lambda m: pass_beside(search.problem, m, search.passed))

    names = list(beside.effects)
    if not search.first.on_grid:  # a ripple alone raised the alarm
        effects = search.problem.stack.rig.effects
        names = [n for n in names if effects[n].fingerprint.covariate == TURNING]
    top = max((beside.gain(name) for name in names), default=0.0)
    alone = TUNING.search.little if model.names else 0.0
    least = max(alone, TUNING.search.predicted_share * top - TUNING.search.predicted_less)
    likely = [name for name in names if beside.gain(name) > least]
    known = model.evidence - beside.alone if stand is model else 0.0
    return [
        Predicted(model, known + beside.evidence(n), _starts(search, model, beside, n), stand)
        for n in likely
    ]


def together(search: EffectSearch) -> list[Predicted]:
    """The likeliest pairs of effects beside the bare model, where one of them was fitted alone: the
    likelier one, beside which the other begins.
    """
    stand, first = search.stand, search.passed
    if len(first.effects) < 2 or not search.first.on_grid:
        return []
    most = TUNING.search.together
    alone, out = {model.names[0]: model for model in search.sized(1)}, []
    for pair in attempted(lambda: pairs_beside(search.problem, stand, first, most)) or []:
        fitted = [alone[name] for one in pair.each if (name := str(one.signature.of)) in alone]
        if fitted:
            model = max(fitted, key=lambda m: m.evidence)
            other = next(one for one in pair.each if one.signature.of not in model.names)
            sizes = (*other.sizes, *(0 for _ in model.chosen[len(stand.chosen) :]))
            out.append(Predicted(model, pair.evidence, (replace(other, sizes=sizes),), model))
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
