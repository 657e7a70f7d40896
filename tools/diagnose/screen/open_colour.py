"""Whether slow noise alone explains it: evidence of a misfit with size and colour of the noise left
open.

The pass whitens with one colour for each channel, found with everything explained away
(noise/estimate.py). Short campaigns leave that colour wide open: what tells slow noise lies in the
slow part of the residual, and there the saturated mean takes it. A misfit that stands out of the
assumed colour may then be noise of a slower one. So what raised the alarm is weighed once more:
base model and base model with the misfit, each with the colours that suit *it*, averaged over what
they may be. A misfit that follows its covariate through all runs is far likelier than noise that
happens to; slow noise that looks like a trend is not.

Linear about the fit, Gaussian priors: for noise of covariance Σ, columns C of unit prior, and at
the fit y = measured − predicted + C θ,

    ln p(y) = −½ [yᵀΣ⁻¹y − bᵀK⁻¹b + ln det K + ln det Σ],   K = I + CᵀΣ⁻¹C,   b = CᵀΣ⁻¹y

(Gelman et al., Bayesian Data Analysis, 3rd ed., ch. 14). Channels share the columns, so colours are
sought one channel after the other, from those that suit each alone; the average of each is over its
own colours and sizes, the other channels' at their best.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.special import logsumexp

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.parallel import each
from gritd.tools.diagnose.fit.evidence import Signature, strength_sizes
from gritd.tools.diagnose.fit.problem import Fitted, Problem
from gritd.tools.diagnose.noise.colour import (
    Colour,
    Noise,
    innovation_variance,
    products_of_innovations,
)
from gritd.tools.diagnose.noise.estimate import colours, log_prior, restricted
from gritd.tools.diagnose.rig.interface import Bools, Index
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import RIDGE, SLIGHT


@dataclass(frozen=True)
class Squares:
    """Products of a channel's whitened columns, for each colour (g, m, m); log det of the
    correlation (g,); values. The same of the signatures and y in this channel alone, with the
    base eliminated: left (g, r, r), log det (g,) and free values.
    """

    gram: Array
    log_det: Array
    count: int
    left: Array
    left_log_det: Array
    free: int


@dataclass(frozen=True)
class SuitableColours:
    """Colours that may suit a channel: products (k, p + 1, p + 1), what their size adds (k,),
    variance (k,), values.
    """

    gram: Array
    rest: Array
    variance: Array
    count: int


class OpenNoise:
    """Evidence of signatures on top of a fit, with the colour of every channel open."""

    def __init__(
        self, problem: Problem, fitted: Fitted, signatures: Sequence[Signature], jobs: int = 1
    ) -> None:
        """jobs: processes."""
        stack = problem.stack
        centre = np.concatenate((fitted.u, fitted.x))
        base = np.column_stack(
            (
                fitted.raw / fitted.penalty[: len(centre)],
                problem.nuisance.columns.dense,
                fitted.nuisance.carried.dense,
            )
        )
        y = stack.measured - fitted.predicted + fitted.raw @ centre
        columns = np.column_stack((base, *(s.columns for s in signatures), y))

        self._base = np.arange(base.shape[1])
        ends = base.shape[1] + np.cumsum([0, *(s.columns.shape[1] for s in signatures)])
        self._own = [np.arange(low, high) for low, high in pairwise(ends.tolist())]
        self._share = [s.prior for s in signatures]
        self._y = columns.shape[1] - 1

        self._colours = colours()
        self._prior = log_prior(self._colours, stack.gaps)

        def squares(own: Bools) -> Squares:
            of = columns[own], stack.gaps_of(own), problem.noise, own, self._colours
            return _squares(*of, self._base.size)

        channels = (stack.of(channel) for channel in stack.rig.channels)
        self._squares = each(jobs, squares, [own for own in channels if own.any()])
        self._without = self._evidence(np.zeros(0, dtype=np.intp))

    def gain(self, number: int) -> float:
        """Log Bayes factor of a signature [nats], its share among all that were tried counted."""
        return self._evidence(self._own[number]) - self._without + self._share[number]

    def _evidence(self, more: Index) -> float:
        """Log evidence with some more columns, averaged over their sizes."""
        index = np.concatenate((self._base, more, [self._y]))
        scales = strength_sizes() if more.size else strength_sizes()[:1]
        prior = np.ones((len(scales), index.size - 1))
        prior[:, self._base.size :] = scales[:, None] ** -2

        parts = [self._suiting(squares, more) for squares in self._squares]
        at = [
            int(np.argmax(part.rest - 0.5 * part.count * np.log(part.variance))) for part in parts
        ]
        size = [1.0 for _ in parts]

        peaks: list[tuple[float, float]] = []
        for _ in range(TUNING.numerics.colour_sweeps):
            peaks = []
            for i, part in enumerate(parts):
                others = [
                    _term(p, a, s)
                    for j, (p, a, s) in enumerate(zip(parts, at, size, strict=True))
                    if j != i
                ]
                value = _averaged(part, prior, others)
                best = np.unravel_index(int(np.argmax(value)), value.shape)
                at[i], size[i] = int(best[0]), float(np.array(TUNING.screen.colour_sizes)[best[1]])
                peaks.append((float(value.max()), float(logsumexp(value))))
        return peaks[-1][0] + sum(average - top for top, average in peaks)

    def _suiting(self, squares: Squares, more: Index) -> SuitableColours:
        own = np.append(more, self._y)
        left = squares.left[:, own[:, None] - self._base.size, own - self._base.size]
        acting = np.flatnonzero(np.diagonal(left[0]) > 0.0)
        alone, variance = restricted(
            left[:, acting[:, None], acting], squares.left_log_det, squares.free
        )
        near = np.flatnonzero(
            alone + self._prior > (alone + self._prior).max() - TUNING.numerics.colour_near
        )
        rest = self._prior[near] - 0.5 * squares.log_det[near]
        index = np.concatenate((self._base, own))
        gram = squares.gram[near[:, None, None], index[:, None], index]
        return SuitableColours(gram, rest, variance[near], squares.count)


def _squares(
    columns: Array, gaps: Array, noise: Noise, own: Bools, tried: Sequence[Colour], base: int
) -> Squares:
    """Of one channel's columns (n, m), so many of the base first, its values marked (N,).

    What is uncertain of single values is known in the channel's unit. Of a colour the recordings
    tell the size of its innovations: by these the colours are of equal size.
    """
    (number,) = np.unique(noise.stack.channel[own])
    assumed = noise.colours[number]
    innovations = innovation_variance(gaps, [assumed, *tried])
    share = innovations[1:] / innovations[0]  # of the assumed variance, by that of each colour

    beside = noise.beside[own][:, None] * share
    gram, log_det = products_of_innovations(columns / noise.times[own, None], gaps, tried, beside)
    return Squares(gram, log_det, len(columns), *_left(gram, log_det, len(columns), base))


def _left(gram: Array, log_det: Array, count: int, base: int) -> tuple[Array, Array, int]:
    """Of products (g, m, m) what is left with the columns of the base eliminated, whatever their
    size: products, log det and free values (estimate.restricted).
    """
    acting = np.flatnonzero(np.diagonal(gram[0])[:base] > 0.0)
    order = np.concatenate((acting, np.arange(base, gram.shape[1])))
    own = gram[:, order[:, None], order]
    diagonal = np.einsum("...ii->...i", own)[:, :-1]  # a view
    usual = diagonal[:, : acting.size].sum(axis=1, keepdims=True) / max(acting.size, 1)
    diagonal += RIDGE * np.where(diagonal > 0.0, np.maximum(usual, diagonal), 0.0)
    left, spread = _eliminated(own, acting.size)
    return left, log_det + 2.0 * spread, max(count - acting.size, 1)


def _term(part: SuitableColours, at: int, size: float) -> tuple[Array, float]:
    """What a channel of known colour adds to the products and to the log evidence."""
    variance = part.variance[at] * size**2
    return part.gram[at] / variance, float(part.rest[at] - 0.5 * part.count * np.log(variance))


def _averaged(part: SuitableColours, prior: Array, others: Sequence[tuple[Array, float]]) -> Array:
    """Log evidence (k, sizes) for every colour and size of one channel, averaged over the priors
    (s, p).
    """
    products = sum((o[0] for o in others), np.zeros(part.gram.shape[1:]))
    more = sum(o[1] for o in others)
    # the first columns have one prior, whatever the size of the rest: eliminated once for all
    # sizes, and those that do nothing in this channel for all colours too
    alike = int(np.argmin(np.append(np.all(prior == prior[0], axis=0), False)))
    acts = np.diagonal(part.gram[0]) > 0.0
    elsewhere = np.flatnonzero(~acts[:alike])
    here = np.concatenate((np.flatnonzero(acts[:alike]), np.arange(alike, acts.size)))
    first = here.size - (acts.size - alike)
    order = np.concatenate((elsewhere, here))
    beside, apart = _without_first(products[order[:, None], order], prior[0, elsewhere])
    own = part.gram[:, here[:, None], here]

    averaged = []
    for size in TUNING.screen.colour_sizes:  # one at a time: the products take memory
        variance = part.variance * size**2
        gram = own / variance[:, None, None] + beside
        rest, spread = _without_first(gram, prior[0, here[:first]])
        every = [_log_evidence(rest, p[alike:]) for p in prior]
        added = part.rest - 0.5 * part.count * np.log(variance) + more - apart
        averaged.append(logsumexp(every, axis=0) - np.log(len(prior)) - spread + added)
    return np.stack(averaged, axis=1)


def _without_first(gram: Array, prior: Array) -> tuple[Array, Array]:
    """Products (…, p + 1, p + 1) of columns and y with the first columns eliminated, of prior
    precision (f,), and half of what these add to the log determinant.
    """
    with_prior = gram.copy()
    diagonal = np.einsum("...ii->...i", with_prior)[..., : prior.size]  # a view
    diagonal[...] = _with_prior(diagonal, prior)
    rest, spread = _eliminated(with_prior, prior.size)
    return rest, spread - 0.5 * float(np.log(prior).sum())


def _eliminated(gram: Array, first: int) -> tuple[Array, Array]:
    """Products (…, m, m) with so many of the first columns eliminated, and half of their log
    determinant.
    """
    padded = gram.copy()
    diagonal = np.einsum("...ii->...i", padded)  # a view
    # of the rest the root's last rows are not wanted: anything that keeps it positive
    diagonal[..., first:] += 1.0 + diagonal[..., first:].sum(axis=-1, keepdims=True)

    root = np.linalg.cholesky(padded)
    across = root[..., first:, :first]
    own = np.log(np.diagonal(root, axis1=-2, axis2=-1)[..., :first]).sum(axis=-1)
    rest = gram[..., first:, first:] - across @ across.swapaxes(-1, -2)
    return np.asarray(rest), np.asarray(own)


def _log_evidence(gram: Array, prior: Array) -> Array:
    """From products (…, p + 1, p + 1) of columns and y, and the prior precision (p,) of the
    columns.
    """
    rest, spread = _without_first(gram, prior)
    return np.asarray(-0.5 * rest[..., -1, -1] - spread)


def _with_prior(squares: Array, prior: Array) -> Array:
    """Diagonal (…, p) of products and prior. A column is known to a millionth: of very quiet
    recordings the prior is less than rounding.
    """
    return np.asarray(squares + prior + SLIGHT**2 * squares)
