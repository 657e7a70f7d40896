"""The prior of the soil together with the discrepancy of form that was learnt with it.

A campaign shows the sum of what the equations give and δ. What of it is soil and what is δ is known
less well than either: their errors have opposite signs. A filter that took them for independent
would learn c from the same sum a second time (docs/decisions/0009). So while the soil of the
configuration is the one that δ was learnt with, the filter begins with their correlation, and with
that of c, tan φ and k. Where the soil has been changed since, it is another soil, and independent.
"""

from __future__ import annotations

from math import isclose

import numpy as np

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.estimate import STATES
from gritd.estimator.model.learnt import LearntSoil
from gritd.estimator.terramechanics.soil import Array

SAME = 1e-6  # relative difference up to which a soil is the one that was written


def learnt_soil(settings: Settings) -> LearntSoil | None:
    """The correlation of δ with the soil of the configuration; None where there is none."""
    form, soil = settings.discrepancy, settings.soil
    if form is None or form.soil is None:
        return None
    now = (soil.cohesion.value, soil.tan_phi.value, soil.shear_modulus.value)
    alike = [isclose(a, b, rel_tol=SAME) for a, b in zip(now, form.soil.values, strict=True)]
    return form.soil if all(alike) else None


def with_learnt_soil(P: Array, columns: slice, settings: Settings) -> Array:
    """The prior's covariance (d, d) with the correlations of the soil, with itself and with the
    directions of δ in `columns`.
    """
    learnt = learnt_soil(settings)
    if learnt is None:
        return P

    P, sigma = P.copy(), np.sqrt(np.diag(P)[:STATES])
    c_tan, c_k, tan_k = learnt.among
    among = np.array([[1.0, c_tan, c_k], [c_tan, 1.0, tan_k], [c_k, tan_k, 1.0]])
    P[:STATES, :STATES] = among * sigma[:, None] * sigma
    cross = np.array(learnt.correlations) * sigma[:, None]
    P[:STATES, columns] = cross
    P[columns, :STATES] = cross.T
    return P
