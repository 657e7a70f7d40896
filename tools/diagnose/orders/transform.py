"""Fourier sums of readings at uneven places."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.orders.stretches import Complexes

WINDOW = 8  # grid points that a reading is spread over


def fourier_sums(place: Array, values: Array, spacing: float, count: int) -> Complexes:
    """Σ y e^(−2πi k d x) for k = 0 … count − 1, of values y (n,) at places x (n,), spacing d.

    By spreading the readings over a regular grid, a fast Fourier transform, and the inverse of what
    the spreading damps; the error is 1e-7 of Σ|y|. Source: Barnett, Magland, af Klinteberg (2019),
    SIAM J. Sci. Comput. 41, C479-C504, section 3, with twice as fine a grid.
    """
    # a power of two, twice as fine as the window's highest frequency asks for, at least 8 windows
    size = 1 << int(np.ceil(np.log2(max(4 * count, 8 * WINDOW))))
    at = np.mod(place * spacing, 1.0) * size
    first = np.floor(at).astype(np.int64) - (WINDOW // 2 - 1)

    spread = np.zeros(size)
    for step in range(WINDOW):
        weight = _kernel((at - (first + step)) / (0.5 * WINDOW))
        spread += np.bincount(np.mod(first + step, size), values * weight, size)
    damped = _damping(count, size)
    return np.asarray(np.fft.rfft(spread)[:count] / damped)


def sums_at(place: Array, values: Array, at: Array) -> Complexes:
    """Σ y e^(−2πi f x) at evenly spaced f (k,), of values y (n,) at places x (n,)."""
    wave = values * np.exp(-2j * np.pi * at[0] * place)
    step = np.exp(-2j * np.pi * (at[1] - at[0]) * place)
    sums = np.empty(at.size, complex)
    for number in range(at.size):
        sums[number] = wave.sum()
        wave *= step
    return sums


def _kernel(x: Array) -> Array:
    """Of the window (n,), x from −1 to 1: exp(β (√(1 − x²) − 1)), β = 2.3 grid points (ibid.)."""
    inside = np.sqrt(np.maximum(1.0 - x**2, 0.0))
    return np.asarray(np.exp(2.3 * WINDOW * (inside - 1.0)) * (np.abs(x) < 1.0))


@lru_cache(maxsize=8)
def _damping(count: int, size: int) -> Array:
    """The window's Fourier transform at 0 … count − 1 cycles in `size` grid points."""
    frequency = np.arange(count) / size
    # 40 nodes integrate the window to the rounding of a float
    nodes, weights = np.polynomial.legendre.leggauss(40)
    half = 0.5 * WINDOW
    waves = np.cos(2.0 * np.pi * half * np.outer(frequency, nodes))
    return np.asarray(waves @ (half * weights * _kernel(nodes)))
