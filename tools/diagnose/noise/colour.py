"""The noise of each channel: its size and colour; whitening.

A value's noise is white noise plus two Ornstein-Uhlenbeck processes: a fast one (what neighbouring
slopes share) and a slow one of correlation time τ. Its size and colour are found in estimate.py. A
value is a mean over an interval Δ. A mean of slow noise is smoother than slow noise: means k > 0
intervals apart have the covariance

    (cosh x − 1) / (x − 1 + e⁻ˣ) e⁻ᵏˣ,   x = Δ/τ

in units of their variance, as an Ornstein-Uhlenbeck process of more than their variance beside a
white one of the difference, which is negative.
What is uncertain of a single value is white noise beside these. It hides the slow noise at that
value and does not make it larger.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from gritd.estimator.compiled import whitening
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Bools, Index
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SLIGHT


@dataclass(frozen=True)
class Colour:
    """Noise of one channel: σ of a grid value; correlation time [s] and share of the slow part;
    share of the fast.
    """

    sigma: float
    time: float
    slow: float
    fast: float = 0.0

    def shared(self, step: float) -> float:
        """Share of the slow part by what neighbouring means over an interval [s] have in common."""
        if not self._of_means(step):
            return self.slow
        x = step / self.time
        return float(self.slow * (np.cosh(x) - 1.0) / (x - 1.0 + np.exp(-x)))

    def kept(self, gaps: Array, step: float) -> Array:
        """What the slow part keeps over gaps [s]; means over an interval are no nearer than it."""
        apart = np.maximum(gaps, step) if self._of_means(step) else gaps
        return np.asarray(np.exp(-apart / self.time))

    def _of_means(self, step: float) -> bool:
        """Values as far apart as slow noise lasts are readings rather than means."""
        return step <= self.time


@dataclass(frozen=True)
class Noise:
    """A colour for each channel to whiten with."""

    stack: Stack
    colours: tuple[Colour, ...]
    uncertain: Array  # (N,) what adds to the noise of single values, same unit as the value
    # (N, m) what each run may do for itself, each column one standard deviation (replicates.py)
    of_runs: Array
    rougher: Array | float = 1.0  # (N,) or for all, by what all parts of the noise are larger

    @cached_property
    def loose(self) -> Array:
        """(N,) by how much a value's noise exceeds its channel's."""
        return np.asarray(np.hypot(self.times, self.uncertain / self._sigma))

    @cached_property
    def times(self) -> Array:
        """(N,) by what all parts of a value's noise are larger than its channel's."""
        return np.broadcast_to(np.asarray(self.rougher, float), self.uncertain.shape)

    @cached_property
    def beside(self) -> Array:
        """(N,) variance of the white noise beside a value's own, whose variance is 1."""
        return np.asarray((self.uncertain / (self._sigma * self.times)) ** 2)

    @cached_property
    def _sigma(self) -> Array:
        """(N,) of each value's channel."""
        return np.asarray(np.array([c.sigma for c in self.colours])[self.stack.channel])

    @cached_property
    def whitener(self) -> sparse.csr_matrix:
        """(N, N): values to units of independent unit noise; each run and channel for itself."""
        blocks = []
        for channel, number in self.stack.parts:
            colour = self.colours[self.stack.rig.channels.index(channel)]
            own = self.stack.of(channel) & (self.stack.run == number)
            unit = unit_whitener(self.stack.gaps[own], colour, self.beside[own])
            unit.data /= (colour.sigma * self.times[own])[unit.indices]
            blocks.append(unit)
        return sparse.block_diag(blocks, format="csr")

    @cached_property
    def _last_touched(self) -> Index:
        """(N,) the last innovation in which a value weighs."""
        by_value = self.whitener.tocsc()
        return np.asarray(by_value.indices[by_value.indptr[1:] - 1], dtype=np.intp)

    def touched(self, first: int, end: int) -> slice:
        """Innovations in which the values from first to before end weigh."""
        return slice(first, int(self._last_touched[first:end].max()) + 1)


def unit_whitener(gaps: Array, colour: Colour, beside: Array | None = None) -> sparse.csr_matrix:
    """(n, n): n values of unit variance to innovations, without weights that are negligible.
    beside: (n,) variance of white noise beside it.

    The Kalman filter of two OU processes observed in white noise; a gap of inf starts anew.
    Diagonal by diagonal: what every value weighs in the innovation so many values later. All are
    soon forgotten, so the matrix is a narrow band.
    """
    kept, gain, scale = (np.squeeze(p, -1) for p in _recursion(gaps, [colour], beside))
    kept, gain = kept[..., 0], gain[..., 0]
    forgotten = TUNING.numerics.negligible * scale.min(initial=1.0)

    slow, fast = np.zeros(gaps.size), np.zeros(gaps.size)
    values, rows, columns = [], [], []
    for lag in range(gaps.size):
        left = gaps.size - lag
        slow, fast = slow[:left] * kept[0, lag:], fast[:left] * kept[1, lag:]
        innovation = float(lag == 0) - slow - fast

        weight = innovation / scale[lag:]
        acting = np.flatnonzero(np.abs(weight) >= TUNING.numerics.negligible).astype(np.int32)
        values.append(weight[acting])
        rows.append(acting + np.int32(lag))
        columns.append(acting)

        slow, fast = slow + gain[0, lag:] * innovation, fast + gain[1, lag:] * innovation
        if np.max(np.abs(slow) + np.abs(fast)) < forgotten:
            break

    if not values:
        return sparse.csr_matrix((0, 0))
    entries = (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_matrix((np.concatenate(values), entries), shape=(gaps.size, gaps.size))


def products_of_innovations(
    columns: Array, gaps: Array, colours: Sequence[Colour], beside: Array | None = None
) -> tuple[Array, Array]:
    """Products (g, m, m) of the innovations of columns (n, m) under noise of g colours and unit
    variance; log det of each covariance. beside: (n,) or (n, g) variance of white noise beside it.

    Linear in n, and the innovations are never all in memory. Columns of zeros have none.
    """
    acting = np.flatnonzero(columns.any(axis=0))
    recursion = _recursion(gaps, colours, beside)
    rows = max(TUNING.numerics.whitened_at_once // max(len(colours) * acting.size, 1), 1)

    own = np.zeros((len(colours), acting.size, acting.size))
    for piece in _innovations(columns[:, acting], recursion, rows):
        own += piece.transpose(0, 2, 1) @ piece
    gram = np.zeros((len(colours), columns.shape[1], columns.shape[1]))
    gram[:, acting[:, None], acting] = own
    return gram, np.asarray(2.0 * np.log(recursion[2]).sum(axis=0))


def _innovations(
    columns: Array, recursion: tuple[Array, Array, Array], at_once: int
) -> Iterator[Array]:
    """Of so many rows after the other, (g, k, m)."""
    columns, (length, colours) = np.ascontiguousarray(columns, dtype=float), recursion[2].shape
    slow, fast = (np.zeros((colours, columns.shape[1])) for _ in range(2))

    for first in range(0, length, max(at_once, 1)):
        rows = range(first, min(first + at_once, length))
        out = np.empty((colours, len(rows), columns.shape[1]))
        if whitening.BUILT:
            sizes = (length, colours, columns.shape[1], first, len(rows))
            whitening.fill(columns, *recursion, slow, fast, out, *sizes)
        else:
            _follow(columns, recursion, slow, fast, out, rows)
        yield out


def _follow(
    columns: Array,
    recursion: tuple[Array, Array, Array],
    slow: Array,
    fast: Array,
    out: Array,
    rows: range,
) -> None:
    """Fills `out` (g, k, m) with the innovations of some rows, from and to the states slow and fast
    (g, m) of both processes: compiled/innovations.c with the same bits.
    """
    kept, gain, scale = recursion
    for place, i in enumerate(rows):
        slow *= kept[0, i]
        fast *= kept[1, i]

        innovation = columns[i] - slow - fast
        out[:, place] = innovation
        slow += gain[0, i] * innovation
        fast += gain[1, i] * innovation
    out /= scale[rows.start : rows.stop].T[:, :, None]


def innovation_variance(gaps: Array, colours: Sequence[Colour]) -> Array:
    """Usual variance (g,) of an innovation of noise of each colour and unit variance."""
    return np.asarray(np.median(_recursion(gaps, colours)[2] ** 2, axis=0))


def _recursion(
    gaps: Array, colours: Sequence[Colour], beside: Array | None = None
) -> tuple[Array, Array, Array]:
    """Decay since the value before (2, n, g, 1), gains (2, n, g, 1), standard deviation of the
    innovation (n, g). beside: (n,) or (n, g) variance of white noise beside that of each colour.
    """
    step = step_of(gaps)
    share = np.array([[c.shared(step) for c in colours], [c.fast for c in colours]])
    own = np.zeros(len(gaps)) if beside is None else beside

    fast_kept = np.exp(-gaps / (TUNING.noise.fast_time * step))
    slow_kept = np.stack([c.kept(gaps, step) for c in colours], axis=-1)
    kept = np.stack((slow_kept, np.broadcast_to(fast_kept[:, None], slow_kept.shape)))
    white = 1.0 - share.sum(axis=0) + (own if own.ndim > 1 else own[:, None])
    gain, variance = np.empty_like(kept), np.empty(kept.shape[1:])
    if whitening.BUILT:
        whitening.gains(kept, share, white, gain, variance, len(gaps), len(colours))
    else:
        _gains(kept, share, white, gain, variance)
    return kept[..., None], gain[..., None], np.maximum(np.sqrt(variance), SLIGHT)


def _gains(kept: Array, share: Array, white: Array, gain: Array, variance: Array) -> None:
    """Fills gains (2, n, g) and variances (n, g): compiled/innovations.c with the same bits."""
    slow, fast = share
    ss, ff, sf = slow, fast, 0.0 * slow
    for i, ((a, b), alone) in enumerate(zip(kept.swapaxes(0, 1), white, strict=True)):
        ss, ff = a * a * ss + slow * (1 - a * a), b * b * ff + fast * (1 - b * b)
        sf = a * b * sf
        to_slow, to_fast = ss + sf, ff + sf
        total = to_slow + to_fast + alone
        by_slow, by_fast = to_slow / total, to_fast / total
        gain[0, i], gain[1, i], variance[i] = by_slow, by_fast, total
        ss, ff, sf = ss - to_slow * by_slow, ff - to_fast * by_fast, sf - to_slow * by_fast


def step_of(gaps: Array) -> float:
    """The grid's interval [s], from the times (n,) since the value before."""
    inside = gaps[np.isfinite(gaps)]
    return float(np.median(inside)) if inside.size else 1.0


def whiten(noise: Noise, columns: Array) -> Array:
    """Columns (N, m) or (N,) in units of independent unit noise."""
    return np.asarray(noise.whitener @ columns)


def whiten_rows(noise: Noise, columns: Array, rows: Bools) -> Array:
    """The same of columns (n, m) on some values; rows (N,) marks every value of the channels that
    they touch.
    """
    return np.asarray(noise.whitener[rows][:, rows] @ columns)


def covariance(colour: Colour, time: Array, gaps: Array) -> Array:
    """Of noise of a colour (n, n) at times (n,)."""
    step, apart = step_of(gaps), np.abs(time[:, None] - time[None, :])
    slow = np.where(apart > 0.0, colour.kept(apart, step), 1.0)
    fast = np.exp(-apart / (TUNING.noise.fast_time * step))
    shared = colour.shared(step)
    white = (1.0 - shared - colour.fast) * np.eye(len(time))
    return np.asarray(colour.sigma**2 * (white + shared * slow + colour.fast * fast))
