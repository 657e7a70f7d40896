"""Pressure of earth on what is pushed through it."""

from __future__ import annotations

import numpy as np

from gritd.tools.proof.blind.plant.quadrature import Array

WEIGHT = 15e3  # unit weight of the soil γ [N/m³]


def passive(tan_phi: Array | float) -> Array:
    """Coefficient of passive earth pressure K_p = (1 + sin φ)/(1 − sin φ) (Rankine), (n,) as
    tan φ.
    """
    sine = np.sin(np.arctan(tan_phi))
    return np.asarray((1.0 + sine) / (1.0 - sine))
