"""The filter's algebra in plain floats: the default engine, equal to filterpy's to rounding.

Only the rows of the state are touched, because a considered nuisance never changes. With M = P Hᵀ +
C Gᵀ and N = Cᵀ Hᵀ + V Gᵀ, the covariances of state and nuisances with what is predicted, and S that
of the innovations, Joseph's form reads, for any gain K,

    P − K Mᵀ + (K S − M) Kᵀ        and for the correlation with the nuisances        C − K Nᵀ
"""

from __future__ import annotations

from gritd.estimator.compiled import arithmetic
from gritd.estimator.filter.estimate import (
    LN_K,
    STATES,
    Estimate,
    Matrix,
    Update,
    Vector,
    cross_covariances,
    dot,
)


class PlainEngine:
    """See engine.Engine. One or two measured components, written out: loops over two cost more than
    the algebra.
    """

    def __init__(self, nuisance_variances: Vector) -> None:
        self._variances = nuisance_variances

    def update(self, estimate: Estimate, update: Update, consider_k: bool) -> Estimate:
        apply = self._one if len(update.innovation) == 1 else self._two
        return apply(estimate, update, LN_K if consider_k else STATES)

    def _one(self, estimate: Estimate, update: Update, states: int) -> Estimate:
        (y,), (h,), (g,), ((r,),) = update
        m, n = cross_covariances(estimate, self._variances, h, g)
        s = dot(h, m) + dot(g, n) + r
        gain = _kept([value / s for value in m], states)
        x = tuple([value + k * y for value, k in zip(estimate.x, gain, strict=True)])
        cross = tuple(
            [
                tuple([c - k * seen for c, seen in zip(row, n, strict=True)])
                for row, k in zip(estimate.cross, gain, strict=True)
            ]
        )
        rest = [k * s - value for k, value in zip(gain, m, strict=True)]
        P = [
            [p + e * k - d * value for p, k, value in zip(row, gain, m, strict=True)]
            for row, d, e in zip(estimate.P, gain, rest, strict=True)
        ]

        return Estimate(x, _symmetric(P), cross)

    def _two(self, estimate: Estimate, update: Update, states: int) -> Estimate:
        (y, z), (h_y, h_z), (g_y, g_z), ((r_y, r_yz), (_, r_z)) = update
        m_y, n_y = cross_covariances(estimate, self._variances, h_y, g_y)
        m_z, n_z = cross_covariances(estimate, self._variances, h_z, g_z)
        s_y = dot(h_y, m_y) + dot(g_y, n_y) + r_y
        s_yz = dot(h_y, m_z) + dot(g_y, n_z) + r_yz
        s_z = dot(h_z, m_z) + dot(g_z, n_z) + r_z
        determinant = s_y * s_z - s_yz * s_yz
        a, b, d = s_z / determinant, -s_yz / determinant, s_y / determinant
        k_y = _kept([a * u + b * v for u, v in zip(m_y, m_z, strict=True)], states)
        k_z = _kept([b * u + d * v for u, v in zip(m_y, m_z, strict=True)], states)
        x = tuple([value + k * y + q * z for value, k, q in zip(estimate.x, k_y, k_z, strict=True)])
        cross = tuple(
            [
                tuple([c - k * u - q * v for c, u, v in zip(row, n_y, n_z, strict=True)])
                for row, k, q in zip(estimate.cross, k_y, k_z, strict=True)
            ]
        )
        e_y = [k * s_y + q * s_yz - u for k, q, u in zip(k_y, k_z, m_y, strict=True)]
        e_z = [k * s_yz + q * s_z - v for k, q, v in zip(k_y, k_z, m_z, strict=True)]
        P = [
            [
                p - k_y[i] * u - k_z[i] * v + e_y[i] * k + e_z[i] * q
                for p, u, v, k, q in zip(row, m_y, m_z, k_y, k_z, strict=True)
            ]
            for i, row in enumerate(estimate.P)
        ]

        return Estimate(x, _symmetric(P), cross)


class CompiledEngine:
    """The same, compiled (compiled/algebra.c), to the same bits."""

    def __init__(self, nuisance_variances: Vector) -> None:
        self._variances = nuisance_variances

    def update(self, estimate: Estimate, update: Update, consider_k: bool) -> Estimate:
        states = LN_K if consider_k else STATES
        x, P, cross = estimate
        y, H, G, R = update
        return Estimate(*arithmetic.update(x, P, cross, self._variances, y, H, G, R, states))


def _kept(gain: list[float], states: int) -> list[float]:
    """The gain with the rows of considered states set to zero."""
    return gain if states == STATES else [*gain[:states], *(0.0,) * (STATES - states)]


def _symmetric(P: list[list[float]]) -> Matrix:
    """The lower triangle, mirrored."""
    (a, _, _), (b, d, _), (c, e, f) = P
    return (a, b, c), (b, d, e), (c, e, f)
