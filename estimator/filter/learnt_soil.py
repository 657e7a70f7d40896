"""The prior of the soil beside the discrepancy of form that was learnt with it.

A campaign shows the sum of what the equations give and δ. What of it is soil and what is δ is known
less well than either: their errors have opposite signs. A filter that took them for independent
would learn c from the same sum a second time (docs/decisions/0009). So while the soil of the
configuration is the one that δ was learnt with, the filter begins with their correlation, and with
that of c, tan φ and k. Where the soil has been changed since, it is another soil, and independent.
"""

from __future__ import annotations

from math import isclose

from gritd.estimator.config.settings import Settings
from gritd.estimator.filter.estimate import STATES, Estimate
from gritd.estimator.model.learnt import LearntSoil

SAME = 1e-6  # relative difference up to which a soil is the one that was written


def learnt_soil(settings: Settings) -> LearntSoil | None:
    """The correlation of δ with the soil of the configuration; None where there is none."""
    form, soil = settings.discrepancy, settings.soil
    if form is None or form.soil is None:
        return None
    now = (soil.cohesion.value, soil.tan_phi.value, soil.shear_modulus.value)
    alike = [isclose(a, b, rel_tol=SAME) for a, b in zip(now, form.soil.values, strict=True)]
    return form.soil if all(alike) else None


def with_learnt_soil(prior: Estimate, settings: Settings) -> Estimate:
    """The prior (diagonal P) with its correlations: P (3, 3), and cross (3, q), whose last columns
    are the discrepancy's.
    """
    learnt = learnt_soil(settings)
    if learnt is None:
        return prior

    sigma = [prior.P[i][i] ** 0.5 for i in range(STATES)]
    c_tan, c_k, tan_k = learnt.among
    among = ((1.0, c_tan, c_k), (c_tan, 1.0, tan_k), (c_k, tan_k, 1.0))
    P = tuple(
        tuple([among[i][j] * sigma[i] * sigma[j] for j in range(STATES)]) for i in range(STATES)
    )

    cross = []
    for row, correlation, own in zip(prior.cross, learnt.correlations, sigma, strict=True):
        kept = row[: len(row) - len(correlation)]
        cross.append((*kept, *[own * value for value in correlation]))
    return Estimate(prior.x, P, tuple(cross))
