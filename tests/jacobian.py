"""Shared by the tests: one check for every analytic Jacobian."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def assert_jacobian(
    f: Callable[[Array], Sequence[float] | Array],
    jacobian: Sequence[Sequence[float]] | Array,
    x: Sequence[float] | Array,
    *,
    step: Sequence[float] | Array | float = 1e-4,
    rtol: float = 1e-7,
    atol: float = 0.0,
) -> None:
    """Compare `jacobian`, of shape (len(f), len(x)), with central differences of f at x.

    step: one for all entries of x or one each; the differences are fourth-order, so their error is
        of order step⁴.
    rtol: relative to the largest entry of each row scaled by `step`, i.e. to the largest change f
        makes in one step.
    """
    point = np.asarray(x, dtype=float)
    steps = np.broadcast_to(np.asarray(step, dtype=float), point.shape)
    analytic = np.atleast_2d(np.asarray(jacobian, dtype=float))
    numeric = np.column_stack(
        [_difference(f, point, index, steps[index]) for index in range(point.size)]
    )

    assert analytic.shape == numeric.shape, (
        f"Jacobian has shape {analytic.shape}, expected {numeric.shape}"
    )

    scale = np.max(np.abs(numeric * steps), axis=1, keepdims=True)
    error = np.abs(analytic - numeric) * steps
    worst = np.unravel_index(np.argmax(error / (scale + np.finfo(float).tiny)), error.shape)

    assert np.all(error <= rtol * scale + atol * steps), (
        f"d f[{worst[0]}] / d x[{worst[1]}]: analytic {analytic[worst]:.12g}, "
        f"differences {numeric[worst]:.12g}"
    )


def _difference(
    f: Callable[[Array], Sequence[float] | Array], x: Array, index: int, step: float
) -> Array:
    def at(offset: float) -> Array:
        moved = x.copy()
        moved[index] += offset * step
        return np.atleast_1d(np.asarray(f(moved), dtype=float))

    return (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step)
