"""The noise of each channel, size and colour, from the recordings themselves; whitening and
surrogates with it.

Model: a value's noise is white noise plus two Ornstein-Uhlenbeck processes, a fast one (what
neighbouring slopes share) and a slow one of correlation time τ. It is fitted by restricted maximum
likelihood (Patterson and Thompson 1971, Biometrika 58, 545-554) with a *saturated* mean: soil,
calibration, the effects' signatures and smooth functions of the covariates. What any of these could
explain therefore does not count as noise, and what they take away by chance is counted as lost
freedom. The residual of the base model alone is never used: it holds the misfit, and prewhitening
with the misfit's own colour makes wrong effects win. The configured noise is not used at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.ndimage import median_filter
from scipy.signal import lfilter

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.rig.interface import Bools, Index, Stack

SLOW_TIMES = (0.5, 1.0, 2.0, 4.0, 10.0)  # [s] correlation times of the slow part tried
SLOW = (0.02, 0.06, 0.15, 0.3, 0.5, 0.75, 0.95)  # its shares of the variance tried
FAST = (0.0, 0.4, 0.9)  # shares of the rest that the fast part takes
FAST_TIME = 1.5  # correlation time of the fast part, in grid intervals
SURROGATE_COLOURS = 20  # drawn from the posterior of the colour
RIDGE = 1e-9
NEGLIGIBLE = 1e-5  # weight of a value long past in an innovation
STEADY = (
    1.3  # values noisier than this share of their channel's, for blur, say nothing of the noise
)
CAREFUL = 0.6  # quantile of slow power in its posterior that the whitening assumes
# prior: density of a colour falls as its slow power to this, since instruments drift less than they
# hiss
RARE = 0.5
COLUMNS = 40  # of the saturated mean, at most
# of the residual: what changes less at its expected size explains nothing, it is a solver's
# rounding
SLIGHT = 1e-4


@dataclass(frozen=True)
class Colour:
    """Noise of one channel: σ of a grid value; correlation time [s] and share of the slow part;
    share of the fast.
    """

    sigma: float
    time: float
    slow: float
    fast: float = 0.0


@dataclass(frozen=True)
class Noise:
    """A colour for each channel to whiten with, and draws from its posterior for surrogates."""

    stack: Stack
    colours: tuple[Colour, ...]
    draws: tuple[tuple[Colour, ...], ...]  # per channel
    uncertain: Array  # (N,) what adds to the noise of single values, same unit as the value

    @cached_property
    def loose(self) -> Array:
        """(N,) by how much a value's noise exceeds its channel's."""
        sigma = np.array([c.sigma for c in self.colours])[self.stack.channel]
        return np.asarray(np.sqrt(1.0 + (self.uncertain / sigma) ** 2))

    @cached_property
    def whitener(self) -> sparse.csr_matrix:
        """(N, N): values to units of independent unit noise; each run and channel for itself."""
        blocks = []
        for channel, number in self.stack.parts:
            colour = self.colours[self.stack.rig.channels.index(channel)]
            own = self.stack.of(channel) & (self.stack.run == number)
            inverse = whiten_unit(np.eye(int(own.sum())), self.stack.gaps[own], [colour])[0][0]
            inverse[np.abs(inverse) < NEGLIGIBLE] = 0.0
            blocks.append(sparse.csr_matrix(inverse / (colour.sigma * self.loose[own])))
        return sparse.block_diag(blocks, format="csr")


BLUR = (
    0.5  # of the bend between neighbours: speeds are slopes over three intervals, corners are cut
)
SHALLOW = 1e-3  # [m] a sinkage below which its changes mean little
# [s] by which an axle sinks later than in the balance: its damping carries or adds load meanwhile
LAG = 0.015


def blur(stack: Stack, predicted: Array) -> Array:
    """Error (N,) where things change: averaging takes a share of the second difference, a value's
    or its neighbours'; and a lagging axle shifts all forces by the share by which the sinkage
    changes within the lag. A rig that passes prediction and measurement through the same filters
    says so by `blurs = False`.
    """
    if not getattr(stack.rig, "blurs", True):
        return np.zeros(stack.size)
    gaps = np.where(np.isfinite(stack.gaps), stack.gaps, np.inf)
    bend = np.abs(np.diff(predicted, n=2, prepend=predicted[:1], append=predicted[-1:]))
    edge = ~np.isfinite(stack.gaps) | ~np.isfinite(np.append(stack.gaps[1:], np.inf))
    late = np.abs(np.diff(predicted, prepend=predicted[:1])) / gaps
    if "sinkage" in stack.rig.runs[0].covariates:
        depth = np.log(np.maximum(stack.covariate("sinkage"), SHALLOW))
        late = late + np.abs(predicted * np.diff(depth, prepend=depth[:1])) / gaps
    return np.asarray(np.hypot(BLUR * _nearby(np.where(edge, 0.0, bend)), LAG * _nearby(late)))


def _nearby(values: Array) -> Array:
    """The largest of each value and its neighbours."""
    return np.maximum(values, np.maximum(np.roll(values, 1), np.roll(values, -1)))


SPIKE = 6.0  # [σ] from the median of its neighbours: such a value counts as much less certain
NEIGHBOURS = 5


def spikes(stack: Stack, predicted: Array, colours: Sequence[Colour]) -> Array:
    """(N,) how far a single value stands off its neighbours, where that is beyond SPIKE; else 0."""
    residual = stack.measured - predicted
    off = np.abs(residual - median_filter(residual, NEIGHBOURS, mode="nearest"))
    sigma = np.array([c.sigma for c in colours])[stack.channel]
    return np.where(off > SPIKE * sigma, off, 0.0)


def uncertain(stack: Stack, predicted: Array, colours: Sequence[Colour]) -> Array:
    """(N,) what adds to the noise of single values: blur, spikes, and what is left open of the
    motion.
    """
    return np.hypot(
        np.hypot(blur(stack, predicted), spikes(stack, predicted, colours)), stack.unsure
    )


def first_guess(stack: Stack, predicted: Array) -> Noise:
    """White noise from the differences between neighbours, which a slow misfit hardly touches."""
    residual, colours = stack.measured - predicted, []
    for channel in stack.rig.channels:
        inside = stack.of(channel) & np.isfinite(stack.gaps)
        step = np.diff(residual, prepend=0.0)[inside]
        sigma = 1.4826 * float(np.median(np.abs(step))) / np.sqrt(2.0) if step.size else 1.0
        colours.append(Colour(max(sigma, _least(stack, channel)), SLOW_TIMES[0], 0.0))
    return Noise(
        stack, tuple(colours), tuple((c,) for c in colours), uncertain(stack, predicted, colours)
    )


def fit(
    stack: Stack,
    predicted: Array,
    saturated: tuple[Array, Array],
    cells: Index,
    before: Noise,
    rng: np.random.Generator,
) -> Noise:
    """Size and colour of each channel, from the prediction (N,).

    The saturated mean: columns (N, p), of which the leading directions count, columns (N, r) which
    all count, and the means of the cells (N,), −1 where there is none (see replicates.py).
    """
    found = [
        _fit_channel(
            stack,
            channel,
            stack.measured - predicted,
            saturated,
            cells,
            _steady(stack, channel, before),
            rng,
        )
        for channel in stack.rig.channels
    ]
    colours = tuple(f[0] for f in found)
    return Noise(stack, colours, tuple(f[1:] for f in found), uncertain(stack, predicted, colours))


def _steady(stack: Stack, channel: str, before: Noise) -> Bools:
    """Values of a channel that are hardly noisier than it is; at least half of them."""
    own = stack.of(channel)
    if not own.any():
        return own
    steady: Bools = own & (before.loose <= max(STEADY, float(np.median(before.loose[own]))))
    return steady


def _fit_channel(
    stack: Stack,
    channel: str,
    residual: Array,
    saturated: tuple[Array, Array],
    cells: Index,
    own: Bools,
    rng: np.random.Generator,
) -> tuple[Colour, ...]:
    mean = saturated_mean(residual[own], saturated[0][own], saturated[1][own], cells[own])
    columns = np.column_stack((mean, residual[own]))
    tried = colours()
    whitened, log_det = whiten_unit(columns, stack.gaps_of(own), tried)
    likelihood, variance = restricted(whitened.transpose(0, 2, 1) @ whitened, log_det, len(columns))
    posterior = likelihood + log_prior(tried, stack.gaps)
    weight = np.exp(posterior - posterior.max())
    least = _least(stack, channel)
    sized = [
        replace(c, sigma=max(float(np.sqrt(v)), least))
        for c, v in zip(tried, variance, strict=True)
    ]
    chosen = rng.choice(len(sized), SURROGATE_COLOURS, p=weight / weight.sum())
    return _careful(sized, weight / weight.sum(), _step(stack.gaps)), *(sized[i] for i in chosen)


def colours() -> list[Colour]:
    """All that are tried, of unit size."""
    slow = [Colour(1.0, t, w, f * (1.0 - w)) for t in SLOW_TIMES for w in SLOW for f in FAST]
    return slow + [Colour(1.0, SLOW_TIMES[0], 0.0, f) for f in FAST]


def log_prior(tried: Sequence[Colour], gaps: Array) -> Array:
    """Of each colour, up to a constant."""
    return np.asarray(-RARE * np.log([_slow_power(c, _step(gaps)) for c in tried]))


def _careful(colours: Sequence[Colour], weight: Array, step: float) -> Colour:
    """The colour whose slow power is at quantile CAREFUL of the posterior: few data cannot tell
    slow noise.
    """
    power = np.array([c.sigma**2 * _slow_power(c, step) for c in colours])
    order = np.argsort(power)
    at = int(np.searchsorted(np.cumsum(weight[order]), CAREFUL))
    return colours[int(order[min(at, len(colours) - 1)])]


def _slow_power(colour: Colour, step: float) -> float:
    """Spectral density towards zero frequency, relative to that of white noise of the same
    variance.
    """
    return 1.0 - colour.slow + 2.0 * colour.slow * colour.time / step


def restricted(gram: Array, log_det: Array, count: int) -> tuple[Array, Array]:
    """Restricted log-likelihood of each colour with the size maximised out, and the variance.

    gram: (g, m + 1, m + 1) products of the whitened columns of the mean, and of the values last; of
        so many values.
    """
    inner, size = gram[:, :-1, :-1], gram.shape[1] - 1
    inner = inner + RIDGE * np.trace(inner, axis1=1, axis2=2)[:, None, None] / max(
        size, 1
    ) * np.eye(size)
    root = np.linalg.cholesky(inner)
    taken = np.linalg.solve(root, gram[:, :-1, -1:])[:, :, 0]
    free = max(count - size, 3)
    variance = np.maximum(gram[:, -1, -1] - np.sum(taken**2, axis=1), 1e-300) / free
    spread = 2.0 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    return -0.5 * (free * np.log(variance) + log_det + spread), variance


def saturated_mean(residual: Array, columns: Array, sure: Array, cells: Index) -> Array:
    """Means of the cells, the columns that all count, and the leading directions of the others;
    orthonormal.

    Of the others those that would explain some of the residual (n,) at their expected size.
    """
    held = (cells[:, None] == np.unique(cells[cells >= 0])).astype(float)
    held = np.column_stack((held, sure[:, np.any(sure != 0.0, axis=0)]))
    held = basis(held, held.shape[1])
    beside = columns - held @ (held.T @ columns)
    acting = np.linalg.norm(beside, axis=0) > SLIGHT * np.linalg.norm(residual)
    return np.column_stack((held, basis(beside[:, acting])))


def basis(columns: Array, most: int = COLUMNS) -> Array:
    """Orthonormal columns that span most of the same space, no more than a quarter of the rows."""
    scale = np.linalg.norm(columns, axis=0)
    columns = columns[:, scale > 0.0] / scale[scale > 0.0]
    if not columns.size:
        return np.zeros((columns.shape[0], 0))
    values, vectors = np.linalg.eigh(columns.T @ columns)
    kept = np.flatnonzero(values > 1e-7 * max(values[-1], 1e-300))[
        -max(min(columns.shape[0] // 4, most), 1) :
    ]
    basis: Array = columns @ (vectors[:, kept] / np.sqrt(values[kept]))
    return basis


def _least(stack: Stack, channel: str) -> float:
    """A noise no channel is below: 1e-5 of its size. Noise-free simulations still need a scale."""
    values = stack.measured[stack.of(channel)]
    return 1e-5 * float(np.sqrt(np.mean(values**2))) + 1e-12 if values.size else 1.0


def whiten_unit(columns: Array, gaps: Array, colours: Sequence[Colour]) -> tuple[Array, Array]:
    """Innovations (g, n, m) of columns (n, m) under noise of g colours and unit variance; log det
    of each correlation.

    The Kalman filter of two OU processes observed in white noise; a gap of inf starts anew. Linear
    in n.
    """
    kept, gain, scale = _recursion(gaps, colours)
    out = np.empty((len(colours), *columns.shape))
    slow, fast = (
        np.zeros((len(colours), columns.shape[1])),
        np.zeros((len(colours), columns.shape[1])),
    )
    for i in range(len(columns)):
        slow *= kept[0, i]
        fast *= kept[1, i]
        innovation = columns[i] - slow - fast
        out[:, i] = innovation
        slow += gain[0, i] * innovation
        fast += gain[1, i] * innovation
    out /= scale.T[:, :, None]
    return out, 2.0 * np.log(scale).sum(axis=0)


def _recursion(gaps: Array, colours: Sequence[Colour]) -> tuple[Array, Array, Array]:
    """Decay since the value before (2, n, g, 1), gains (2, n, g, 1), standard deviation of the
    innovation (n, g).
    """
    times = np.array([[c.time for c in colours], [FAST_TIME * _step(gaps)] * len(colours)])
    share = np.array([[c.slow for c in colours], [c.fast for c in colours]])
    white = 1.0 - share.sum(axis=0)
    kept = np.exp(-gaps[None, :, None] / times[:, None, :])
    gain, scale = np.empty_like(kept), np.empty(kept.shape[1:])
    ss, ff, sf = share[0], share[1], np.zeros(len(colours))
    for i in range(len(gaps)):
        a, b = kept[0, i], kept[1, i]
        ss, ff, sf = (
            a * a * ss + share[0] * (1 - a * a),
            b * b * ff + share[1] * (1 - b * b),
            a * b * sf,
        )
        to_slow, to_fast = ss + sf, ff + sf
        total = to_slow + to_fast + white
        gain[0, i], gain[1, i], scale[i] = to_slow / total, to_fast / total, np.sqrt(total)
        ss, ff, sf = ss - to_slow * gain[0, i], ff - to_fast * gain[1, i], sf - to_slow * gain[1, i]
    return kept[..., None], gain[..., None], np.maximum(scale, 1e-6)


def _step(gaps: Array) -> float:
    inside = gaps[np.isfinite(gaps)]
    return float(np.median(inside)) if inside.size else 1.0


def whiten(noise: Noise, columns: Array) -> Array:
    """Columns (N, m) or (N,) in units of independent unit noise."""
    return np.asarray(noise.whitener @ columns)


def surrogates(noise: Noise, count: int, rng: np.random.Generator) -> Array:
    """Noise (N, count), size and colour drawn from their posterior: what the recordings hold when
    nothing is amiss.
    """
    stack = noise.stack
    out = np.empty((stack.size, count))
    for channel, draws in zip(stack.rig.channels, noise.draws, strict=True):
        own = stack.of(channel)
        for part, colour in zip(np.array_split(np.arange(count), len(draws)), draws, strict=True):
            out[np.ix_(own, part)] = coloured(stack.gaps[own], len(part), colour, rng)
    return np.asarray(out * noise.loose[:, None])


def coloured(gaps: Array, count: int, colour: Colour, rng: np.random.Generator) -> Array:
    """Noise of a colour (n, count)."""
    white = 1.0 - colour.slow - colour.fast
    out = np.sqrt(white) * rng.standard_normal((len(gaps), count))
    for share, time in ((colour.slow, colour.time), (colour.fast, FAST_TIME * _step(gaps))):
        if share > 0.0:
            out += np.sqrt(share) * _relaxing(gaps, count, time, rng)
    return np.asarray(colour.sigma * out)


def covariance(colour: Colour, time: Array, gaps: Array) -> Array:
    """Of noise of a colour (n, n) at times (n,)."""
    apart = np.abs(time[:, None] - time[None, :])
    slow, fast = np.exp(-apart / colour.time), np.exp(-apart / (FAST_TIME * _step(gaps)))
    white = (1.0 - colour.slow - colour.fast) * np.eye(len(time))
    return np.asarray(colour.sigma**2 * (white + colour.slow * slow + colour.fast * fast))


def _relaxing(gaps: Array, count: int, time: float, rng: np.random.Generator) -> Array:
    """An Ornstein-Uhlenbeck process of unit variance (n, count): on the regular grid, then where it
    is used.
    """
    step = _step(gaps)
    apart = 5 * (1 + round(time / step))  # grid places between runs: enough to forget
    place = np.cumsum(
        np.maximum(np.rint(np.where(np.isfinite(gaps), gaps / step, apart)), 1.0)
    ).astype(int)
    kept = float(np.exp(-step / time))
    kicks = rng.standard_normal((int(place[-1]) + 1, count)) * np.sqrt(1.0 - kept**2)
    return np.asarray(lfilter([1.0], [1.0, -kept], kicks, axis=0)[place])
