"""The vertical axis: the entry angle at which the soil carries the weight, and how the axle gets
there.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gritd.tools.proof.blind.plant.quadrature import Array

DEEPEST, SHALLOWEST = 1.45, 1e-4  # [rad] bounds of the entry angle
STEPS = 12
CLOSE = 1e-8  # relative error of the load at which the search ends


def balance(load_at: Callable[[Array], Array], weight: Array, guess: Array) -> Array:
    """θ₁ (n,) [rad] where `load_at(θ₁)` (n,) is the weight (n,) [N], by secants in ln W over ln θ₁,
    where it is nearly a line; guess (n,) [rad].
    """
    wanted = np.log(np.maximum(weight, 1e-6))
    old = np.log(np.clip(guess, SHALLOWEST, DEEPEST))
    new = np.log(np.clip(1.02 * np.exp(old), SHALLOWEST, 0.999 * DEEPEST))
    miss_old = _miss(load_at, old, wanted)

    for _ in range(STEPS):
        miss = _miss(load_at, new, wanted)
        if (
            np.max(
                np.abs(np.where((new > np.log(DEEPEST) - 1e-9) & (miss < 0.0), 0.0, miss)),
                initial=0.0,
            )
            < CLOSE
        ):
            break

        run = new - old
        slope = np.where(
            np.abs(run) > 1e-13, (miss - miss_old) / np.where(run == 0.0, 1.0, run), 2.0
        )
        step = -miss / np.clip(slope, 0.5, 12.0)
        old, miss_old = new, miss
        new = np.clip(new + np.clip(step, -1.5, 1.5), np.log(SHALLOWEST), np.log(DEEPEST))

    return np.exp(new)


def _miss(load_at: Callable[[Array], Array], log_theta: Array, wanted: Array) -> Array:
    return np.log(np.maximum(load_at(np.exp(log_theta)), 1e-9)) - wanted


def settled(target: Array, moving: Array, step: float, lag: float) -> Array:
    """The sinkage (n,) [m] of a damped axle that follows its balance with time constant `lag` [s].

    target: sinkage in balance (n,) [m]; moving (n,): 0 at rest, 1 in motion; step of time [s].

    Soil does not spring back: a wheel at rest may sink further but does not rise.
    """
    gain = 1.0 - np.exp(-step / lag)
    depth = float(target[0])
    path = []

    for goal, free in zip(target.tolist(), moving.tolist(), strict=True):
        gap = goal - depth
        depth += gain * (gap if gap > 0.0 else gap * free)
        path.append(depth)

    return np.array(path)
