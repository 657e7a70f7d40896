"""What to do next: from a feasible menu, the least effort that decides, else what decides most.

Between rivals, a driven experiment is foreseen: each rival, at its fit, is simulated under the proposed motion; the
expected gain is half the squared distance of their predictions in units of noise (the Kullback-Leibler divergence of
two equal Gaussians), for what the uncertainty of the soil leaves of it. Where the recordings were insufficient, what is
foreseen are the effects that they could not have shown, each at its expected size; where the physics is not in the
list, the condition along which the misfit lives is stepped. An instrument's reading is worth half the squared parameter
over a fifth of its expected size.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from estimator.effects import EFFECTS
from estimator.effects.base import EXPERIMENTS, Effect
from estimator.terramechanics.soil import Array
from tools.diagnose.decide import Decision
from tools.diagnose.result import NextExperiment
from tools.diagnose.select import Model, Search
from tools.diagnose.wheel_rig import WheelRig

DRIVEN = (  # by effort
    "standstill",
    "reversal",
    "slip_step",
    "speed_step",
    "shifted_start",
    "second_pass",
    "load_step",
    "lifted_spin",
)
ALONG = {  # the covariate along which a misfit lives -> what shows its shape
    "slip": "slip_step", "speed": "speed_step", "acceleration": "speed_step", "load": "load_step",
    "sinkage": "load_step", "position": "shifted_start", "time": "long_run", "heat": "long_run", "run": "second_pass",
    "direction": "reversal", "velocity": "reversal", "wheel_angle": "lifted_spin", "constant": "lifted_spin",
}  # fmt: skip
INSTRUMENT = 0.2  # of an expected size: what tape, level or clamp meter can tell
MODELLED = 0.02  # of a channel's size: no rival predicts an experiment better than this
EVERY = 10  # foreseen values that count as one: neighbours share their noise
ENOUGH, MOST = 10.0, 50.0  # [nats] that decide; more than MOST are said as MOST
RIVALS = 3
STEP = 0.1  # [σ] of a constant, for differences


def next_experiment(search: Search, decision: Decision) -> NextExperiment | None:
    """None where model and recordings agree, or one explanation stands alone."""
    if decision.verdict == "insufficient":
        return _first_of(_unseen_shown(search), ())
    if decision.verdict == "unlisted":
        return _shape_of_misfit(search)
    rivals = _rivals(search, decision)
    if len(rivals) < 2:
        return None
    names = tuple(dict.fromkeys(n for m in rivals for n in m.names if n not in _common(rivals)))
    gains = {key: _told_apart(search, rivals, key) for key in DRIVEN}
    for key, gain in _measured(rivals).items():
        gains[key] = max(gains.get(key, 0.0), gain)
    return _first_of(gains, names) or _by_hand(names)


def _first_of(gains: Mapping[str, float], separates: tuple[str, ...]) -> NextExperiment | None:
    """The least effort that decides, else the largest gain."""
    if not gains or max(gains.values()) <= 0.0:
        return None
    deciding = [key for key, gain in gains.items() if gain >= ENOUGH]
    key = deciding[0] if deciding else max(gains, key=lambda k: gains[k])
    gain = min(gains[key], MOST)
    return NextExperiment(key, EXPERIMENTS[key], separates, gain, float(1.0 / (1.0 + np.exp(-gain))))


def _by_hand(names: Sequence[str]) -> NextExperiment | None:
    """What the rivals' own files name, where nothing can be foreseen."""
    for name in names:
        for other, key in EFFECTS[name].confusable_with.items():
            if other in names:
                return NextExperiment(key, EXPERIMENTS[key], tuple(names), float("nan"), float("nan"))
    return None


# ---- rivals --------------------------------------------------------------------------------------------------------


def _rivals(search: Search, decision: Decision) -> list[Model]:
    best, groups = decision.best, decision.groups.values()
    same = [m for m in search.models if len(m.names) == len(best.names)]
    close = [m for m in same if any(set(m.names) - set(best.names) <= set(g) for g in groups)]
    return sorted(close, key=lambda m: -m.evidence)[:RIVALS] if best.names else []


def _common(rivals: list[Model]) -> set[str]:
    return set.intersection(*(set(m.names) for m in rivals))


def _told_apart(search: Search, rivals: list[Model], key: str) -> float:
    """Smallest expected gain between the first and another rival [nats]."""
    rig = search.problem.stack.rig
    if not isinstance(rig, WheelRig):
        return 0.0
    first, *others = rivals
    here, slopes = _foreseen(search, key, first.fitted.u, first.fitted.acting)
    return min(
        _gain(search, here, _values(rig.foresee(key, m.fitted.u, m.fitted.acting)) - _values(here), slopes)
        for m in others
    )


def _measured(rivals: list[Model]) -> dict[str, float]:
    """Experiments the rivals' own files name, by what an instrument would tell."""
    out: dict[str, float] = {}
    for one in rivals:
        for f, x in zip(one.fitted.free, one.fitted.x, strict=True):
            for other, key in EFFECTS[f.name].confusable_with.items():
                if key not in DRIVEN and any(other in m.names for m in rivals) and f.parameter.role == "strength":
                    out[key] = max(out.get(key, 0.0), min(0.5 * float(x / INSTRUMENT) ** 2, MOST))
    return out


# ---- insufficient, and not in the list -----------------------------------------------------------------------------


def _unseen_shown(search: Search) -> dict[str, float]:
    """Of every driven experiment the median gain over effects that these recordings could not show [nats]."""
    rig, base = search.problem.stack.rig, search.models[0]
    if not isinstance(rig, WheelRig):
        return {}
    unseen = [_expected(rig.effects[name]) for name in _not_shown(search)]
    out = {}
    for key in DRIVEN if unseen else ():
        here, slopes = _foreseen(search, key, base.fitted.u, ())
        changes = [_values(rig.foresee(key, base.fitted.u, (effect,))) - _values(here) for effect in unseen]
        out[key] = float(np.median([_gain(search, here, change, slopes) for change in changes]))
    return out


def _not_shown(search: Search) -> list[str]:
    """Effects whose signature, at their expected size, is below the alarm."""
    base, found = search.models[0].fitted.base(), search.screens[()]
    size = {name: float(np.trace(base.projected(w.columns)[0])) for name, w in found.best.items() if "~" not in name}
    return [name for name, squared in size.items() if 0.5 * squared < found.threshold]


def _expected(effect: type[Effect]) -> Effect:
    """The effect at its expected size."""
    sizes = {p.name: p.off + p.sigma for p in effect.parameters() if p.role == "strength"}
    return effect(
        **{p.name: float(np.clip(sizes[p.name], p.low, p.high)) for p in effect.parameters() if p.name in sizes}
    )


def _shape_of_misfit(search: Search) -> NextExperiment | None:
    """A step of the condition along which the misfit lives; the gain is its evidence so far, for as much again."""
    evidence = {name: e for name, e in search.screens[()].evidence.items() if "~" in name}
    if not evidence:
        return None
    name = max(evidence, key=lambda n: evidence[n])
    key = ALONG.get(name.partition("~")[2].split("·")[0], "slip_step")
    gain = float(np.clip(evidence[name] / max(len(search.problem.stack.rig.runs), 1), 0.0, MOST))
    return NextExperiment(key, EXPERIMENTS[key], (), gain, float(1.0 / (1.0 + np.exp(-gain))))


# ---- what is foreseen ----------------------------------------------------------------------------------------------

Foreseen = Mapping[str, Array]


def _foreseen(search: Search, key: str, u: Array, effects: Sequence[Effect]) -> tuple[Foreseen, Array]:
    """Channels under an experiment, and their change (values, q) for one σ of each soil constant as fitted so far."""
    rig = search.problem.stack.rig
    assert isinstance(rig, WheelRig)
    here = rig.foresee(key, u, effects)
    sigma = np.sqrt(np.diag(search.models[0].fitted.covariance()))
    slopes = []
    for i, known in enumerate(rig.constants):
        if known.soil:
            moved = u.copy()
            moved[i] += STEP
            slopes.append((_values(rig.foresee(key, moved, effects)) - _values(here)) / STEP * sigma[i])
    return here, np.column_stack(slopes)


def _values(foreseen: Foreseen) -> Array:
    return np.concatenate([np.asarray(values)[::EVERY] for values in foreseen.values()])


def _gain(search: Search, here: Foreseen, change: Array, slopes: Array) -> float:
    """Half the squared change in units of noise, the soil's uncertainty among it [nats]."""
    stack = search.problem.stack
    sigma = []
    for (channel, values), colour in zip(here.items(), search.problem.noise.colours, strict=True):
        usual = float(np.sqrt(np.mean(stack.measured[stack.of(channel)] ** 2)))
        sigma.append(np.full(np.asarray(values)[::EVERY].size, np.hypot(colour.sigma, MODELLED * usual)))
    scale = np.concatenate(sigma)
    ready, soil = np.nan_to_num(change) / scale, np.nan_to_num(slopes) / scale[:, None]
    pulled = soil.T @ ready
    return float(0.5 * (ready @ ready - pulled @ np.linalg.solve(np.eye(soil.shape[1]) + soil.T @ soil, pulled)))
