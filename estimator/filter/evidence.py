"""What change.py rests on, in numpy: whitening, normal equations, Bayes factors.

Every sum is made in a stated order: along axes that numpy does not reorder, or in loops, and never
by BLAS or LAPACK, whose order depends on the processor. compiled/record.c gives the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import log, sqrt

import numpy as np

from gritd.estimator.filter.estimate import STATES, Estimate, Vector
from gritd.estimator.filter.line import Line
from gritd.estimator.terramechanics.soil import Array

TINY = 1e-9  # of the prior variances, so that a covariance without full rank has a root
Rows = list[list[float]]


def evidence(
    before: Estimate,
    spread: Vector,
    lines: Sequence[Line],
    windows: Sequence[int],
    own: float,
) -> tuple[Vector, Vector]:
    """ln of the Bayes factors of a change before each of s stretches (s,), and the vector (d,) that
    fits best if nothing changed. Arguments are those of `change.judge`.
    """
    A, y = _whitened(lines, windows, own)
    # accumulated: along the last axis `reduce` would add in pairs
    y = y - np.add.accumulate(A * np.array(before.x), axis=2)[..., -1]
    root = _root(before)
    F = np.add.reduce(A[..., :, None] * np.array(root), axis=2)  # (s, 2, d): of unit normals
    steps = A[..., :STATES] * np.array(spread)  # (s, 2, 3): of the change's normals

    # one soil for all: normal equations of the d normals
    rows = F.reshape(-1, len(root))
    gram = np.eye(len(root)) + np.add.reduce(rows[:, :, None] * rows[:, None, :], axis=0)
    right = np.add.reduce(rows * y.reshape(-1, 1), axis=0)
    factor = cholesky(gram.tolist())
    best = _solved(factor, right.tolist())
    x = [value + _dot(row, best) for value, row in zip(before.x, root, strict=True)]

    # and a change on top of it, from each stretch on
    left = y - np.add.accumulate(F * np.array(best), axis=2)[..., -1]
    shared = _since(_product(F, steps))
    information = _since(_product(steps, steps))
    score = _since(_sum_of_both(steps * left[..., None]))
    explained = _product_of(_forward(factor, shared))
    return _bayes(information - explained, score), tuple(x)


def _whitened(lines: Sequence[Line], windows: Sequence[int], own: float) -> tuple[Array, Array]:
    """H (s, 2, d) and y (s, 2) of unit noise; zeros for a component that is not measured."""
    y, H, R, D, share = (
        np.array(column) for column in zip(*[_full(line) for line in lines], strict=True)
    )
    for at in range(2):
        D[:, at, at] = D[:, at, at] + (own * share[:, at]) * (own * share[:, at])
    noise = R / np.array(windows, float)[:, None, None] + D
    columns = np.concatenate((H, y[:, :, None]), axis=2)

    first = np.sqrt(noise[:, 0, 0])
    slope = noise[:, 1, 0] / first
    second = np.sqrt(noise[:, 1, 1] - slope * slope)
    torque = columns[:, 0] / first[:, None]
    pull = (columns[:, 1] - slope[:, None] * torque) / second[:, None]
    white = np.stack((torque, pull), axis=1)
    return white[..., :-1], white[..., -1]


def _full(line: Line) -> Line:
    """With a second component that says nothing, where only the torque is measured."""
    if len(line.y) == 2:
        return line

    (h,), ((r,),), ((d,),), (share,) = line.H, line.R, line.D, line.share
    nothing = (0.0,) * len(h)
    return Line(
        (*line.y, 0.0), (h, nothing), ((r, 0.0), (0.0, r)), ((d, 0.0), (0.0, d)), (share, share)
    )


def _root(before: Estimate) -> Rows:
    """A root (d, d) of the covariance."""
    joint = before.P
    sigma = [sqrt(row[n]) for n, row in enumerate(joint)]
    scale = [value if value > 0.0 else 1.0 for value in sigma]
    unit = [
        [value / (scale[i] * scale[j]) + (TINY if i == j else 0.0) for j, value in enumerate(row)]
        for i, row in enumerate(joint)
    ]
    return [[s * value for value in row] for s, row in zip(sigma, cholesky(unit), strict=True)]


def cholesky(A: Rows) -> Rows:
    """The lower root of a positive definite matrix. Raises ValueError where it is none."""
    L: Rows = [[0.0] * len(A) for _ in A]
    for i, row in enumerate(A):
        for j in range(i + 1):
            left = row[j] - _dot(L[i][:j], L[j][:j])
            L[i][j] = sqrt(left) if i == j else left / L[j][j]
    return L


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    total = 0.0
    for u, v in zip(a, b, strict=True):
        total += u * v
    return total


def _solved(L: Rows, right: list[float]) -> list[float]:
    """x of L Lᵀ x = right."""
    size, x = len(L), right.copy()
    for i in range(size):
        for k in range(i):
            x[i] -= L[i][k] * x[k]
        x[i] /= L[i][i]

    for i in reversed(range(size)):
        for k in range(i + 1, size):
            x[i] -= L[k][i] * x[k]
        x[i] /= L[i][i]

    return x


def _forward(L: Rows, right: Array) -> Array:
    """V (s, d, 3) of L V = right (s, d, 3)."""
    V = right.copy()
    for i, row in enumerate(L):
        for k in range(i):
            V[:, i] -= row[k] * V[:, k]
        V[:, i] /= row[i]
    return V


def _sum_of_both(values: Array) -> Array:
    """Over the two components of (s, 2, …)."""
    return np.asarray(values[:, 0] + values[:, 1])


def _product(one: Array, other: Array) -> Array:
    """For each stretch the product (s, i, j) over its components."""
    return _sum_of_both(one[..., :, None] * other[..., None, :])


def _product_of(V: Array) -> Array:
    """VᵀV (s, 3, 3) of V (s, d, 3)."""
    return np.asarray(np.add.reduce(V[..., :, None] * V[..., None, :], axis=1))


def _since(values: Array) -> Array:
    """Sums from each stretch to the last, begun with the last."""
    return np.asarray(np.add.accumulate(values[::-1], axis=0)[::-1])


def _bayes(information: Array, score: Array) -> Vector:
    """ln of the Bayes factors (s,) of changes with unit normal prior, from (s, 3, 3) and (s, 3):
    half of zᵀ(1 + Λ)⁻¹z − ln det(1 + Λ).
    """
    a, d, f = (1.0 + information[:, n, n] for n in range(STATES))
    b, c, e = information[:, 1, 0], information[:, 2, 0], information[:, 2, 1]
    one, two, three = score.T

    # pivots of the symmetric elimination, and what is left of the score
    m, n = b / a, c / a
    d, e, f = d - m * b, e - n * b, f - n * c
    two, three = two - m * one, three - n * one
    m = e / d
    f, three = f - m * e, three - m * two
    squares = one * one / a + two * two / d + three * three / f
    sizes = a * d * f
    return tuple(
        [0.5 * (s - log(v)) for s, v in zip(squares.tolist(), sizes.tolist(), strict=True)]
    )
