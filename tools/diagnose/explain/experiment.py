"""What to do next: from a feasible menu, the least effort that decides.

Between rivals, a driven experiment is foreseen: each rival, at its fit, is simulated under the
proposed motion; the expected gain is half the squared distance of their predictions in units of
noise (the Kullback-Leibler divergence of two equal Gaussians), for what the uncertainty of the soil
leaves of it. Where none is expected to tell, it is what the rivals' own files name. Where the
recordings were insufficient, what is foreseen are the effects that they could not have shown, each
at its expected size; where the physics is not in the list, the condition along which the misfit
lives is stepped.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import hypot

import numpy as np

from gritd.estimator.effects.base import Effect
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.explain.result import Location, NextExperiment
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.rig.interface import Foreseen, Rig
from gritd.tools.diagnose.search.models import EffectSearch
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SQUARE
from gritd.tools.diagnose.verdict.decide import shown
from gritd.tools.diagnose.verdict.decision import Decision

State = tuple[Array, Sequence[Effect]]  # constants u (q,), effects as fitted


def next_experiment(
    search: EffectSearch, decision: Decision, location: Sequence[Location]
) -> NextExperiment | None:
    """None where model and recordings agree, or one explanation stands alone."""
    if decision.verdict == "insufficient":
        return _most_shown(search)
    if decision.verdict == "unlisted":
        return _along_misfit(search.problem.stack.rig, location, _mistaken(decision))

    rivals = _rivals(search, decision)
    return _between(search, rivals) if len(rivals) > 1 else None


def _proposed(rig: Rig, key: str, gain: float, separates: tuple[str, ...]) -> NextExperiment:
    probability = float(1.0 / (1.0 + np.exp(-gain)))
    return NextExperiment(key, rig.words.menu.said[key], separates, gain, probability)


# ---- rivals ------------------------------------------------------------------------------------


def _rivals(search: EffectSearch, decision: Decision) -> list[Model]:
    best, groups = decision.best, decision.groups.values()
    same = [m for m in search.models if len(m.names) == len(best.names)]
    close = [m for m in same if any(set(m.names) - set(best.names) <= set(g) for g in groups)]
    return sorted(close, key=lambda m: -m.evidence)[: TUNING.explain.shown] if best.names else []


def _between(search: EffectSearch, rivals: list[Model]) -> NextExperiment | None:
    """What tells most rivals from the first; of equals the least effort."""
    rig = search.problem.stack.rig
    first, *others = (m.fitted for m in rivals)
    one, each = (first.u, first.acting), [(m.u, m.acting) for m in others]
    gains = {k: _gains(search, k, one, each) for k in rig.words.menu.driven}
    pairs = {key: zip(rivals[1:], of, strict=True) for key, of in gains.items()}
    told = {key: [r for r, nats in of if nats >= TUNING.screen.sure] for key, of in pairs.items()}

    best = max(told, key=lambda k: len(told[k]), default="")
    if best and told[best]:
        return _proposed(rig, best, float(np.mean(gains[best])), _apart([rivals[0], *told[best]]))
    return _by_hand(rig, _apart(rivals))


def _apart(rivals: Sequence[Model]) -> tuple[str, ...]:
    """Names that some of these have and others have not."""
    common = set.intersection(*(set(m.names) for m in rivals))
    return tuple(dict.fromkeys(n for m in rivals for n in m.names if n not in common))


def _by_hand(rig: Rig, names: tuple[str, ...]) -> NextExperiment | None:
    """What the rivals' own files name."""
    keys = (rig.effects[one].confusable_with.get(other) for one in names for other in names)
    key = next(filter(None, keys), None)
    return _proposed(rig, key, float("nan"), names) if key else None


# ---- insufficient, and not in the list ---------------------------------------------------------


def _most_shown(search: EffectSearch) -> NextExperiment | None:
    """The experiment with the largest median gain over the effects that these recordings could not
    show, and those that it would show.
    """
    rig, u, seen = search.problem.stack.rig, search.base.fitted.u, shown(search, search.first)
    unseen = {name: _expected(effect) for name, effect in rig.effects.items() if name not in seen}
    each: list[State] = [(u, (one,)) for one in unseen.values()]
    driven = rig.words.menu.driven if unseen else ()
    gains = {key: _gains(search, key, (u, ()), each) for key in driven}

    median = {key: float(np.median(of)) for key, of in gains.items()}
    best = max(median, key=lambda k: median[k], default="")
    if not best or median[best] <= 0.0:
        return None
    least = min(TUNING.screen.sure, median[best])
    told = tuple(n for n, nats in zip(unseen, gains[best], strict=True) if nats >= least)
    return _proposed(rig, best, median[best], told)


def _expected(effect: type[Effect]) -> Effect:
    """The effect at its expected size."""
    strengths = [p for p in effect.parameters() if p.role == "strength"]
    sizes = {p.name: float(np.clip(p.off + p.sigma, p.low, p.high)) for p in strengths}
    return effect(**sizes)


def _mistaken(decision: Decision) -> tuple[str, ...]:
    """What the misfit may be taken for: effects that it resembles, or the likeliest one."""
    likeliest = max(decision.probability, key=lambda n: decision.probability[n], default=None)
    names = tuple(of.name for of in decision.resembled)
    return names or (() if likeliest is None else (likeliest,))


def _along_misfit(
    rig: Rig, location: Sequence[Location], separates: tuple[str, ...]
) -> NextExperiment:
    """A step of the condition along which the misfit lives, to tell some effects from it; the gain
    is its evidence so far, for one run more. A misfit without a place is a ripple of the wheel.
    """
    covariate, q = (location[0].covariate, location[0].q) if location else ("wheel_angle", 1.0)
    gain = -float(np.log(max(q, SQUARE))) / len(rig.runs)
    menu = rig.words.menu
    return _proposed(rig, menu.along.get(covariate, menu.otherwise), gain, separates)


# ---- what is foreseen --------------------------------------------------------------------------


def _gains(search: EffectSearch, key: str, one: State, others: Sequence[State]) -> list[float]:
    """What an experiment is expected to tell between one state and each of some others [nats]: half
    the squared change of what is foreseen in units of noise, the soil's uncertainty among it.
    """
    rig, (u, acting) = search.problem.stack.rig, one
    here = rig.foresee(key, u, acting)
    scale = _values(_noise(search, here))

    def changed(at: Array, effects: Sequence[Effect]) -> Array:
        there = rig.foresee(key, at, effects)
        return np.nan_to_num(_values(there.channels) - _values(here.channels)) / scale

    step, soil = TUNING.fit.derivative_steps[1], []
    for i, constant in enumerate(rig.constants):
        if constant.soil:
            moved = u + step * (np.arange(u.size) == i)
            soil.append(changed(moved, acting) / step * search.base.fitted.sigma[i])

    slopes = np.column_stack(soil)
    inner = np.eye(len(soil)) + slopes.T @ slopes
    gains = []
    for change in (changed(*other) for other in others):
        pulled = slopes.T @ change
        left = float(change @ change - pulled @ np.linalg.solve(inner, pulled))
        gains.append(max(0.5 * left, 0.0))
    return gains


def _values(channels: Mapping[str, Array]) -> Array:
    """One value a second of every channel: neighbours share their noise."""
    return np.concatenate([values[:: round(TUNING.rig.rate)] for values in channels.values()])


def _noise(search: EffectSearch, here: Foreseen) -> dict[str, Array]:
    """Standard deviation of each value; infinite where a channel tells nothing."""
    stack, sigmas = search.problem.stack, {}
    for channel, colour in zip(here.channels, search.problem.noise.colours, strict=True):
        usual = float(np.sqrt(np.mean(stack.measured[stack.of(channel)] ** 2)))
        sigma = hypot(colour.sigma, TUNING.explain.foreseen_error * usual)
        sigmas[channel] = np.where(here.tells[channel], sigma, np.inf)
    return sigmas
