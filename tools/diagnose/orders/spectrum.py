"""Spectra of steady stretches against the wheel angle or time, and the chance of a line in them.

The noise about a place is the geometric mean of its neighbours' power, both sides alike: for a
spectrum that falls by a power law this is the power at the place itself. Beside it the power of
noise is Fisher's F of two degrees of freedom and as many as the neighbours have. Chances of several
parts of the recordings, each with a phase of its own, are multiplied (Fisher 1925, section 21.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import gammaln

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.orders.stretches import Complexes, Ints, Samples
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SQUARE

WINDOW = 8  # grid points that a reading is spread over


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Of one part of a run at the places of a grid (o,).

    power: |Σ y e^(−2πi o x)|²/n in the square of the channel's unit; level: the noise's; infinite
    where nothing is known of it. freedom: degrees of freedom of the level.
    """

    power: Array
    level: Array
    freedom: Array

    @property
    def log_chance(self) -> Array:
        """Of as much power by noise alone (o,)."""
        ratio = self.power / self.level
        return np.asarray(-0.5 * self.freedom * np.log1p(2.0 * ratio / self.freedom))

    def at(self, at: slice) -> Spectrum:
        """At some of the places."""
        return Spectrum(self.power[at], self.level[at], self.freedom[at])

    @property
    def known(self) -> Array:
        """1 where the noise is known (o,)."""
        return np.isfinite(self.level).astype(float)


@dataclass(frozen=True)
class Places:
    """Where lines are looked for: k · spacing, k = 0 … count − 1."""

    spacing: float
    count: int


def places_of(parts: Sequence[Samples], axis: str) -> Places:
    """As dense as the longest part resolves, up to the fastest ripple that some part shows."""
    spacing = 1.0 / (TUNING.orders.density * max(part.span(axis) for part in parts))
    limit = TUNING.orders.highest_order if axis == "angle" else TUNING.orders.highest_frequency
    highest = min(limit, max(fastest(part, axis) for part in parts))
    return Places(spacing, max(int(highest / spacing), 1))


def fastest(part: Samples, axis: str) -> float:
    """The fastest ripple that is no alias, in cycles a turn or a second."""
    steps = np.abs(np.diff(part.of(axis)))
    inside = steps[(np.diff(part.stretch) == 0) & (steps > 0.0)]
    return float(TUNING.orders.nyquist / np.median(inside)) if inside.size else 0.0


def spectrum(part: Samples, axis: str, places: Places) -> Spectrum:
    """Of a part whose values have no trend."""
    sums = fourier_sums(part.of(axis), part.values, places.spacing, places.count)
    power = np.abs(sums) ** 2 / part.values.size
    longest = part.longest(axis)
    low = int(np.ceil(1.0 / longest / places.spacing))
    high = min(int(fastest(part, axis) / places.spacing), places.count)
    level, freedom = _level(power, low, high, places.spacing * part.span(axis))
    level[: int(np.ceil(TUNING.orders.cycles / longest / places.spacing))] = np.inf
    return Spectrum(power, level, freedom)


def _level(power: Array, low: int, high: int, cells: float) -> tuple[Array, Array]:
    """Noise (o,) about each place and its freedom (o,), by places low … high − 1; cells: that the
    part resolves between two places.
    """
    total = np.concatenate(([0.0], np.cumsum(np.log(np.maximum(power, SQUARE)))))
    near, far = (max(round(c / cells), 1) for c in (TUNING.orders.near, TUNING.orders.far))
    at = np.arange(power.size, dtype=np.int64)
    first_known = min(low, power.size)
    last_known = min(max(high, low), power.size)

    def side(begin: Ints, end: Ints) -> tuple[Array, Array]:
        first, last = (np.clip(i, first_known, last_known) for i in (begin, end))
        count = last - first
        mean = np.asarray((total[last] - total[first]) / np.maximum(count, 1), dtype=float)
        return mean, np.asarray(count * cells, dtype=float)

    below, few = side(at - far, at - near + 1)
    above, many = side(at + near, at + far + 1)
    known = (np.minimum(few, many) >= 2.0 * TUNING.orders.near) & (at < high)

    together = 4.0 / (1.0 / np.maximum(few, SQUARE) + 1.0 / np.maximum(many, SQUARE))
    level = np.exp(0.5 * (below + above) + np.euler_gamma)
    # freedom of a geometric mean of exponential values: 6/π² of that of their mean
    freedom = np.maximum(12.0 / np.pi**2 * together, 1.0)
    return np.where(known, level, np.inf), freedom


def log_chance(spectra: Sequence[Spectrum]) -> Array:
    """Chance (o,) of all parts together; 0 where none tells."""
    beside = -np.sum([s.log_chance for s in spectra], axis=0)
    count = np.sum([s.known for s in spectra], axis=0)

    # chance of a sum x of `count` exponential values: e^−x Σ xᵏ/k!, k below count
    logarithm, summed = np.log(np.maximum(beside, SQUARE)), np.full(beside.size, -np.inf)
    for k in range(len(spectra)):
        term = k * logarithm - gammaln(k + 1.0)
        summed = np.where(k < count, np.logaddexp(summed, term), summed)
    return np.where(count > 0, np.minimum(summed - beside, 0.0), 0.0)


# ---- Fourier sums of readings at uneven places ---------------------------------------------------


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
    """Σ y e^(−2πi f x) at f (k,), of values y (n,) at places x (n,)."""
    return np.array([values @ np.exp(-2j * np.pi * f * place) for f in at])


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
