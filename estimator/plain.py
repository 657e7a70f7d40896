"""The filter's algebra in plain floats: the engine of fast replay, equal to filterpy's to rounding.

One or two measured components; the gain is formed with the explicit inverse of the 1×1 or 2×2 innovation covariance,
and only the rows of the state are touched, because a considered nuisance never changes.
"""

from __future__ import annotations

from estimator.filter import LN_K, STATES, Estimate, Matrix, Update, Vector, crossed, dot


class PlainEngine:
    """See filter.Engine."""

    def __init__(self, nuisance_variances: Vector) -> None:
        self._variances = nuisance_variances

    def update(self, estimate: Estimate, update: Update, consider_k: bool) -> Estimate:
        state, nuisance = crossed(estimate, update, self._variances)
        inverse = _inverse(_innovation(state, nuisance, update))
        gain = [tuple([dot(row, column) for row in inverse]) for column in zip(*state, strict=True)]
        if consider_k:
            gain[LN_K] = (0.0,) * len(inverse)
        x = tuple([value + dot(k, update.innovation) for value, k in zip(estimate.x, gain, strict=True)])
        cross = _shrink(estimate.cross, gain, nuisance)
        return Estimate(x, _joseph(_shrink(estimate.P, gain, state), cross, gain, update), cross)


def _innovation(state: Matrix, nuisance: Matrix, update: Update) -> Matrix:
    """S, from the covariances of state and nuisances with the predicted components."""
    h, g = update.H[0], update.G[0]
    first = dot(h, state[0]) + dot(g, nuisance[0]) + update.R[0][0]
    if len(update.H) == 1:
        return ((first,),)
    both = dot(h, state[1]) + dot(g, nuisance[1]) + update.R[0][1]
    second = dot(update.H[1], state[1]) + dot(update.G[1], nuisance[1]) + update.R[1][1]
    return ((first, both), (both, second))


def _inverse(S: Matrix) -> Matrix:
    if len(S) == 1:
        return ((1.0 / S[0][0],),)
    (a, b), (_, d) = S
    determinant = a * d - b * b
    return ((d / determinant, -b / determinant), (-b / determinant, a / determinant))


def _shrink(rows: Matrix, gain: list[Vector], seen: Matrix) -> Matrix:
    """rows − K seen: the left factor (I − KH) of Joseph's form."""
    if len(seen) == 1:
        only = seen[0]
        return tuple(
            [tuple([r - k[0] * s for r, s in zip(row, only, strict=True)]) for row, k in zip(rows, gain, strict=True)]
        )
    first, second = seen
    return tuple(
        [
            tuple([r - k[0] * s - k[1] * t for r, s, t in zip(row, first, second, strict=True)])
            for row, k in zip(rows, gain, strict=True)
        ]
    )


def _joseph(left: Matrix, cross: Matrix, gain: list[Vector], update: Update) -> Matrix:
    """(I − KH) P (I − KH)ᵀ + K R Kᵀ on the state's rows, for any gain K; left and cross carry the left factor."""
    components = list(zip(update.H, update.G, strict=True))
    seen = [[dot(row, h) + dot(c, g) for h, g in components] for row, c in zip(left, cross, strict=True)]
    pull = [
        [dot(k, noise) - s for noise, s in zip(update.R, row, strict=True)] for k, row in zip(gain, seen, strict=True)
    ]  # K R − (I − KH) P Hᵀ
    lower = [[left[i][j] + dot(tuple(pull[i]), gain[j]) for j in range(i + 1)] for i in range(STATES)]
    return tuple(tuple(lower[max(i, j)][min(i, j)] for j in range(STATES)) for i in range(STATES))
