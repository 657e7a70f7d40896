"""Which ripples a turn a residual holds: a cheap look before the physics of each is simulated."""

from __future__ import annotations

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.noise.colour import Noise, whiten
from gritd.tools.diagnose.rig.interface import Stack
from gritd.tools.diagnose.tuning import TUNING


def loudest(stack: Stack, noise: Noise, residual: Array, orders: list[float]) -> list[float]:
    """The orders whose ripple takes most from the whitened residual (N,), each channel with a phase
    of its own.
    """
    phase = np.outer(stack.covariate("wheel_angle"), orders)
    moving = (stack.covariate("speed") > 0.0)[:, None]
    cosine, sine = (
        whiten(noise, np.where(moving, wave, 0.0)) for wave in (np.cos(phase), np.sin(phase))
    )

    power = np.zeros(len(orders))
    for channel in stack.rig.channels:
        own = stack.of(channel)
        taken = (residual[own] @ cosine[own]) ** 2 + (residual[own] @ sine[own]) ** 2
        power += taken / np.maximum(
            np.sum(cosine[own] ** 2, axis=0) + np.sum(sine[own] ** 2, axis=0), 1e-12
        )
    return [orders[i] for i in np.argsort(-power)[: TUNING.screen.loudest]]
