"""Soils of the literature, by name.

TABLE_1 is Table 1 of Shibly, Iagnemma and Dubowsky (2005). Dry sand, sandy loam and clayey soil
were checked against a public simulation's transcript of that table; snow is given from memory and
was not. Their Tables 2 and 3 could not be had: LOOSE_SAND and MARS_LIKE are stand-ins that have
the cohesion (and for the latter the friction angle) of the low-cohesion soils of Table 3, with
moduli, exponent and shear modulus of our choice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from gritd.estimator.terramechanics.soil import PressureSinkage, Soil


@dataclass(frozen=True)
class NamedSoil:
    """A soil as tabulated; `under` gives the Soil that a wheel of some width [m] meets."""

    name: str
    pressure_sinkage: PressureSinkage
    cohesion: float  # c [Pa]
    friction_angle: float  # φ [degrees], as printed
    shear_modulus: float  # k [m]
    source: str

    def under(self, width: float) -> Soil:
        moduli = self.pressure_sinkage
        tan_phi = math.tan(math.radians(self.friction_angle))
        return Soil(
            self.cohesion, tan_phi, self.shear_modulus, moduli.exponent, moduli.modulus(width)
        )


_TABLE_1 = "Shibly et al. (2005), Table 1"

DRY_SAND = NamedSoil(
    "dry sand", PressureSinkage("bekker", 1.1, 0.9e3, 1523.4e3), 1.0e3, 30.0, 0.025, _TABLE_1
)
SANDY_LOAM = NamedSoil(
    "sandy loam", PressureSinkage("bekker", 0.7, 5.3e3, 1515.0e3), 1.7e3, 29.0, 0.025, _TABLE_1
)
CLAYEY_SOIL = NamedSoil(
    "clayey soil", PressureSinkage("bekker", 0.5, 13.2e3, 692.2e3), 4.14e3, 13.0, 0.010, _TABLE_1
)
SNOW = NamedSoil(
    "snow",
    PressureSinkage("bekker", 1.6, 4.4e3, 196.7e3),
    1.0e3,
    19.7,
    0.040,
    _TABLE_1 + ", unchecked",
)

LOOSE_SAND = NamedSoil(
    "loose sand", PressureSinkage("reece", 1.1, 2.0e3, 1500e3), 0.7e3, 31.1, 0.025, "stand-in"
)
MARS_LIKE = NamedSoil(
    "Mars-like", PressureSinkage("reece", 1.1, 1.0e3, 1500e3), 0.22e3, 33.1, 0.025, "stand-in"
)

TABLE_1 = (DRY_SAND, SANDY_LOAM, CLAYEY_SOIL, SNOW)
STAND_INS = (LOOSE_SAND, MARS_LIKE)
SOILS = {soil.name: soil for soil in TABLE_1 + STAND_INS}
