"""Passive earth pressure of a plane blade that pushes soil."""

from __future__ import annotations

import numpy as np

from gritd.estimator.terramechanics.soil import Array, Scalar


def blade_resistance(
    area: Scalar, moment: Scalar, cohesion: Scalar, tan_phi: Scalar, unit_weight: float
) -> Array:
    """Resistance of a vertical blade [N], by Hegedus.

    [cot X + tan(X + φ)] [c A + γ M (cot X + cot² X / cot φ)],   X = 45° − φ/2

    area: A = ∫ h dx of the depth h along the blade [m²]; moment: M = ∫ h²/2 dx [m³]; cohesion: c
    [Pa]; unit_weight: γ [N/m³].
    Source: Hegedus (1960), Land Locomotion Laboratory Report 61, as given by Ishigami et al.
    (2007), J. Field Robotics 24, 233-250.
    """
    phi = np.arctan(tan_phi)
    x = 0.25 * np.pi - 0.5 * phi
    cot_x = 1.0 / np.tan(x)
    wedge = cohesion * area + unit_weight * moment * (cot_x + cot_x**2 * tan_phi)
    return np.asarray((cot_x + np.tan(x + phi)) * wedge)
