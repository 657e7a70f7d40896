"""Evidence for effects whose published form need not be ours.

A listed effect stands for its physics, not for one formula: another form differs from ours by a
smooth share of what the effect does. So the model of an effect that adds S(x) to the channels (N,)
is

    y = f(x) + S(x) + S′(x) h(x),   h(x) = Σ aⱼ φⱼ(x),   aⱼ ~ N(0, ρ²/m)

with m smooth functions φ of unit size in each channel, of a ripple its harmonics too (a discrepancy
after Kennedy and O'Hagan 2001, J. R. Stat. Soc. B 63, 425-464, proportional to the effect). S′ is
all of S, or what of S the soil and the calibration cannot absorb. ρ is how far forms differ: 0 says
that ours is exact. Because the discrepancy grows with the effect, the evidence of rivals for a
strong effect differs by how well their *shapes* agree with what was recorded, not by thousands of
nats. An effect that must be bent by more than ρ has little evidence left, and one that explains
less
than its own bending is not what was recorded: that is how physics outside the library gives itself
    away.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.functions import shares
from gritd.tools.diagnose.fit.problem import Fitted, Problem, build
from gritd.tools.diagnose.noise.colour import whiten
from gritd.tools.diagnose.rig.interface import Stack
from gritd.tools.diagnose.screen.ripples import order_of

WHOLE = (0.05, 0.15, 0.4)  # how far another form may differ, as a share of what the effect does
NET = (0.1, 0.3, 1.0)  # the same of what the base model cannot absorb of it
# share of what an effect explains by itself that its bending may add, and these few nats
BENDING, ALWAYS = 0.3, 2.0
FORMS = 1 + len(WHOLE) + len(NET)  # degrees of difference, none first


def evidence(problem: Problem, fitted: Fitted, base: Fitted) -> Array:
    """Log evidence of fitted effects above the base model's, for each degree to which forms may
    differ (FORMS,).
    """
    added = [_added(problem.stack, fitted, i) for i in range(len(fitted.effects))]
    net = [_net(problem, fitted, one) for one in added]
    bent = np.concatenate(
        [_gains(problem, fitted, parts, rho) for parts, rho in ((added, WHOLE), (net, NET))]
    )
    own = fitted.log_evidence - base.log_evidence
    return own + np.concatenate(([0.0], np.minimum(bent, BENDING * max(own, 0.0) + ALWAYS)))


def _gains(problem: Problem, fitted: Fitted, added: list[Array], sizes: Sequence[float]) -> Array:
    """What a discrepancy of each size adds to the log evidence; the effects add `added` (N,)."""
    columns = _bent(problem.stack, fitted, added)
    if not columns.shape[1]:
        return np.zeros(len(sizes))

    a, b = fitted.projection().project(whiten(problem.noise, columns))
    values, vectors = np.linalg.eigh(0.5 * (a + a.T))
    values, turned = np.maximum(values, 0.0), vectors.T @ b

    gain = [
        np.sum(turned**2 / (values + rho**-2)) - np.log1p(rho**2 * values).sum() for rho in sizes
    ]
    return 0.5 * np.array(gain)


def _bent(stack: Stack, fitted: Fitted, added: list[Array]) -> Array:
    """What each effect adds, times every smooth function in every channel (N, m), for ρ = 1."""
    columns = []
    for number, whole in enumerate(added):
        turns = _harmonics(stack, fitted, number)
        for channel in stack.rig.channels:
            own = np.where(stack.of(channel), whole, 0.0)
            if np.any(own):
                functions = np.column_stack((shares(stack, stack.of(channel)), turns))
                columns.append(own[:, None] * functions / np.sqrt(functions.shape[1]))
    return np.column_stack(columns) if columns else np.zeros((stack.size, 0))


def _net(problem: Problem, fitted: Fitted, added: Array) -> Array:
    """What is left of a change (N,) when the constants of the base model are fitted to it."""
    count = len(fitted.u)
    jacobian = fitted.jacobian[:, :count]
    gram = jacobian.T @ jacobian + np.diag(fitted.penalty[:count] ** 2)
    taken = np.linalg.solve(gram, jacobian.T @ whiten(problem.noise, added))
    return np.asarray(added - fitted.raw[:, :count] @ taken)


def _added(stack: Stack, fitted: Fitted, number: int) -> Array:
    """Prediction with the effect less that without it (N,)."""
    acting = build(fitted.effects, fitted.free, fitted.x)
    return fitted.predicted - stack.predict(
        fitted.u, tuple(e for i, e in enumerate(acting) if i != number)
    )


def _harmonics(stack: Stack, fitted: Fitted, number: int) -> Array:
    """The first two harmonics of a ripple's order (N, 4): times the ripple they give another shape.
    Else (N, 0).
    """
    effect = build(fitted.effects, fitted.free, fitted.x)[number]
    if effect.fingerprint.covariate != "wheel_angle":
        return np.zeros((stack.size, 0))
    name = order_of(type(effect))
    phase = stack.covariate("wheel_angle") * (getattr(effect, name) if name else 1.0)
    waves = [np.sqrt(2.0) * wave(k * phase) for k in (1.0, 2.0) for wave in (np.cos, np.sin)]
    return np.column_stack(waves)
