"""What was known of a constant and what the recordings say of it, where the two may contradict each
other.

A fit takes both for Gaussian: m = prior and recordings weighed by their σ, however far apart they
lie. Recordings that tell little of the soil may still pull it far, by what the form of the model
misses: 15 σ off, each σ twice that of what was known, say. No soil explains that, but Gaussians
cannot doubt. So both have tails here. What was stated of the soil is wrong in one case of a
hundred. The recordings' own σ is known from few independent conditions, so that what they say has
Student's distribution. What contradicts is then doubted, the vaguer of the two first, and two that
agree stay as they were (O'Hagan and Pericchi 2012, Braz. J. Probab. Stat. 26, 372-401).
"""

from __future__ import annotations

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SLIGHT, SUMMED


def reconciled(mean: float, sigma: float) -> tuple[float, float]:
    """Mean and σ in units of the prior σ, about the prior's mean, from those of a Gaussian fit."""
    precision = 1.0 / sigma**2 - 1.0 if sigma > 0.0 else np.inf  # by the recordings: precision
    if not SLIGHT < precision < 1.0 / SLIGHT:
        return mean, sigma
    value, own = mean * (1.0 + precision) / precision, precision**-0.5

    at = _points(value, own)
    density = _prior(at) * _student((at - value) / own)
    weight = density * np.gradient(at)
    weight /= weight.sum()
    middle = float(weight @ at)
    return middle, float(np.sqrt(weight @ (at - middle) ** 2))


def _points(value: float, own: float) -> Array:
    """Where the densities are summed: fine about both, out to where both have ended."""
    unit = np.tan(0.5 * np.pi * np.linspace(-1.0, 1.0, SUMMED)[1:-1])
    return np.unique(np.concatenate((unit, value + min(own, 1.0) * unit)))


def _prior(at: Array) -> Array:
    wrong, far = TUNING.screen.level, TUNING.explain.stated_far
    return np.asarray((1.0 - wrong) * _normal(at) + wrong / far * _normal(at / far))


def _normal(at: Array) -> Array:
    return np.exp(-0.5 * at**2)


def _student(at: Array) -> Array:
    freedom = TUNING.explain.precision_freedom
    return np.asarray((1.0 + at**2 / freedom) ** (-0.5 * (freedom + 1.0)))
