"""The equations of Shibly, Iagnemma and Dubowsky (2005), for floats and arrays, in SI.

`original` has Eqs. (1)-(10), `linear` the closed forms (11)-(22), `soils` the soils of Table 1.

>>> from math import radians
>>> wheel = Wheel(radius=0.072, width=0.071)
>>> soil = soils.DRY_SAND.under(wheel.width)
>>> forces = original.forces(wheel, soil, theta_1=radians(30.0), slip=0.2)
>>> f"DP {float(forces.drawbar_pull):.2f} N, W {float(forces.load):.1f} N"
'DP -1.08 N, W 9.5 N'
"""

from gritd.estimator.terramechanics import linear, original, soils
from gritd.estimator.terramechanics.soil import PressureSinkage, Soil, Wheel

__all__ = ["PressureSinkage", "Soil", "Wheel", "linear", "original", "soils"]
