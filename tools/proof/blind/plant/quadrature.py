"""Tanh-sinh quadrature on a fixed grid: the stresses' fractional powers at the entry angle cost it
no accuracy.

Source: Takahasi and Mori (1974), Publ. RIMS 9, 721-741: x = tanh(π/2 sinh t), trapezoids in t.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP, REACH = (
    0.25,
    2.75,
)  # of t; what lies beyond is below 1e-9 of the integral of a bounded function


class Rule(NamedTuple):
    """On (0, 1): distance of the nodes from either end, exact however near, and weights; arrays
    (m,).
    """

    from_start: Array
    to_end: Array
    weight: Array


def tanh_sinh(step: float = STEP, reach: float = REACH) -> Rule:
    """The rule for ∫₀¹ f(x) dx ≈ Σ weight · f."""
    count = round(reach / step)
    t = step * np.arange(-count, count + 1)
    s = 0.5 * np.pi * np.sinh(t)
    weight = step * 0.25 * np.pi * np.cosh(t) / np.cosh(s) ** 2
    return Rule(1.0 / (1.0 + np.exp(-2.0 * s)), 1.0 / (1.0 + np.exp(2.0 * s)), weight)


RULE = tanh_sinh()
