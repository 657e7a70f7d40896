"""The stresses under the rim by the linear model, at the estimate, for the picture of the wheel."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

import numpy as np

from gritd.estimator.terramechanics.linear import normal_stress, predict, shear_exponent
from gritd.estimator.terramechanics.soil import Wheel

POINTS = 33  # along the arc of contact
NEEDED = ("cohesion", "tan_phi", "shear_modulus", "theta_1", "theta_m", "slip", "load", "sinkage")


def rim(wheel: Wheel, tick: Mapping[str, Any]) -> dict[str, Any] | None:
    """Angles [rad], σ by Eqs. (11), (12) and τ by (2) with (19) [kPa], both from entry to bottom
    dead centre; None where the wheel touches nothing.
    """
    values = [tick.get(name) for name in NEEDED]
    if not all(isinstance(v, int | float) and isfinite(v) for v in values):
        return None
    c, tan_phi, k, theta_1, theta_m, slip, load, sinkage = (
        float(v) for v in values if v is not None
    )
    if not (0.0 < theta_m < theta_1 < 0.5 * np.pi and load > 0.0 and -1.0 < slip <= 1.0):
        return None

    sigma_m = float(predict(wheel, c, tan_phi, k, theta_1, slip, load).sigma_m)
    theta = np.linspace(theta_1, 0.0, POINTS)
    sigma = normal_stress(theta_1, theta_m, sigma_m, theta)
    f = float(shear_exponent(wheel, k, theta_1, slip).f)
    tau = (c + sigma * tan_phi) * np.sign(f) * -np.expm1(-abs(f) * (theta_1 - theta))

    return {
        "radius": wheel.radius,
        "sinkage": sinkage,
        "theta": np.round(theta, 4).tolist(),
        "sigma": np.round(sigma * 1e-3, 3).tolist(),
        "tau": np.round(tau * 1e-3, 3).tolist(),
    }
