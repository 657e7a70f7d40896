"""The wheel and the soil, and the two ways the literature writes the pressure-sinkage law.

Wong and Reece, Eq. (1):  σ = (k₁ + k₂ b)(z/b)ⁿ     k₁ [Pa], k₂ [Pa/m]
Bekker, Table 1:          σ = (k_c/b + k_φ) zⁿ       k_c [Pa/m^(n−1)], k_φ [Pa/mⁿ]

Both become one modulus K of σ = K zⁿ for a wheel of width b; everything inside uses K.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Scalar = float | Array


@dataclass(frozen=True)
class Wheel:
    """A rigid wheel. The angle of maximum stress is θₘ = (c₁ + c₂ i) θ₁, Eq. (5); θ₁/2 by
    default.
    """

    radius: float  # r [m]
    width: float  # b [m]
    c1: float = 0.5
    c2: float = 0.0


@dataclass(frozen=True)
class PressureSinkage:
    """Moduli as tabulated, in either form: bekker (k_c, k_φ) or reece (k₁, k₂)."""

    form: Literal["bekker", "reece"]
    exponent: float  # n [-]
    first: float  # k_c [Pa/m^(n−1)] or k₁ [Pa]
    second: float  # k_φ [Pa/mⁿ] or k₂ [Pa/m]

    def modulus(self, width: float) -> float:
        """K [Pa/mⁿ] of σ = K zⁿ under a wheel of this width [m]."""
        if self.form == "bekker":
            return self.first / width + self.second
        return float((self.first + self.second * width) / width**self.exponent)


@dataclass(frozen=True)
class Soil:
    """Soil under one wheel. Fields are floats, or arrays of one shape (n,) where the soil varies
    by sample.
    """

    cohesion: Scalar  # c [Pa]
    tan_phi: Scalar  # tangent of the internal friction angle [-]
    shear_modulus: Scalar  # k [m], Eq. (2)
    exponent: Scalar  # n [-]
    modulus: Scalar  # K [Pa/mⁿ]
