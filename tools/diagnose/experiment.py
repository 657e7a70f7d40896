"""What to do next: the feasible experiment that best tells the remaining rivals apart.

Driven experiments are foreseen: each rival, at its fit, is simulated under the proposed motion; the expected gain is
half the squared distance of the predictions in units of noise (the Kullback-Leibler divergence of two equal Gaussians).
An instrument's reading is worth half the squared parameter over a fifth of its expected size.
"""

from __future__ import annotations

import numpy as np

from estimator.effects import EFFECTS
from estimator.effects.base import EXPERIMENTS
from tools.diagnose.decide import Decision
from tools.diagnose.result import NextExperiment
from tools.diagnose.select import Model, Search
from tools.diagnose.wheel_rig import WheelRig

DRIVEN = (
    "standstill",
    "lifted_spin",
    "reversal",
    "load_step",
    "slip_step",
    "speed_step",
    "second_pass",
    "shifted_start",
)
INSTRUMENT = 0.2  # of an expected size: what tape, level or clamp meter can tell
MODELLED = 0.02  # of a channel's size: no rival predicts an experiment better than this


def next_experiment(search: Search, decision: Decision) -> NextExperiment | None:
    """None where there is one explanation, or none."""
    rivals = _rivals(search, decision)
    if len(rivals) < 2:
        return None
    names = tuple(dict.fromkeys(n for m in rivals for n in m.names if n not in _common(rivals)))
    gains = {key: _driven(search, rivals, key) for key in DRIVEN}
    for key, gain in _measured(rivals).items():
        gains[key] = max(gains.get(key, 0.0), gain)
    key = max(gains, key=lambda k: gains[k])
    return NextExperiment(key, EXPERIMENTS[key], names, gains[key]) if gains[key] > 0.0 else None


def _rivals(search: Search, decision: Decision) -> list[Model]:
    best, groups = decision.best, decision.groups.values()
    same = [m for m in search.models if len(m.names) == len(best.names)]
    close = [m for m in same if any(set(m.names) - set(best.names) <= set(g) for g in groups)]
    return sorted(close, key=lambda m: -m.evidence)[:3] if best.names else []


def _common(rivals: list[Model]) -> set[str]:
    return set.intersection(*(set(m.names) for m in rivals))


def _driven(search: Search, rivals: list[Model], key: str) -> float:
    """Smallest expected gain between the first and another rival [nats]."""
    rig = search.problem.stack.rig
    if not isinstance(rig, WheelRig):
        return 0.0
    seen = [rig.foresee(key, m.fitted.u, m.fitted.acting) for m in rivals]
    sizes = {c: k.sigma for c, k in zip(rig.channels, search.problem.noise.colours, strict=True)}
    gains = []
    for other in seen[1:]:
        total = 0.0
        for channel, values in seen[0].items():
            sigma = np.hypot(sizes[channel], MODELLED * np.sqrt(np.mean(values**2)))
            total += 0.5 * float(np.mean(((values - other[channel]) / sigma) ** 2)) * 10.0
        gains.append(total)
    return min(gains)


def _measured(rivals: list[Model]) -> dict[str, float]:
    """Experiments the rivals' own files name, by what an instrument would tell."""
    out: dict[str, float] = {}
    for one in rivals:
        for f, x in zip(one.fitted.free, one.fitted.x, strict=True):
            for other, key in EFFECTS[f.name].confusable_with.items():
                if key not in DRIVEN and any(other in m.names for m in rivals) and f.parameter.role == "strength":
                    out[key] = max(out.get(key, 0.0), min(0.5 * float(x / INSTRUMENT) ** 2, 50.0))
    return out
