"""Which ripples a turn a residual holds: a cheap look before the physics of each is simulated."""

from __future__ import annotations

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.noise.colour import Noise, whiten_rows
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SIZE


def loudest(stack: Stack, noise: Noise, residual: Array, orders: list[float]) -> list[float]:
    """The orders whose ripple takes most from the whitened residual (N,), each channel with a phase
    of its own.
    """
    angle, moving = stack.covariate("wheel_angle"), stack.covariate("speed") > 0.0

    power = np.zeros(len(orders))
    for own in (mask for mask in map(stack.of, stack.rig.channels) if mask.any()):
        phase = np.outer(angle[own], orders)
        cosine, sine = (
            whiten_rows(noise, np.where(moving[own, None], wave, 0.0), own)
            for wave in (np.cos(phase), np.sin(phase))
        )
        taken = (residual[own] @ cosine) ** 2 + (residual[own] @ sine) ** 2
        power += taken / np.maximum(np.sum(cosine**2, axis=0) + np.sum(sine**2, axis=0), SIZE)
    return [orders[i] for i in np.argsort(-power)[: TUNING.screen.loudest]]
