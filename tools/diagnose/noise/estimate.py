"""Size and colour of each channel's noise, from the recordings themselves.

Fitted by restricted maximum likelihood (Patterson and Thompson 1971, Biometrika 58, 545-554) with a
*saturated* mean: soil, calibration, the effects' signatures and smooth functions of the covariates.
What any of these could explain therefore does not count as noise, and what they take away by chance
is counted as lost freedom. The residual of the base model alone is never used: it holds the misfit,
and prewhitening with the misfit's own colour makes wrong effects win. The configured noise is not
used at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter

from gritd.estimator.offline.windows import NORMAL
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.parallel import each
from gritd.tools.diagnose.noise import replicates
from gritd.tools.diagnose.noise.blur import blur_of
from gritd.tools.diagnose.noise.colour import Colour, Noise, products_of_innovations, step_of
from gritd.tools.diagnose.noise.lines import standing
from gritd.tools.diagnose.noise.saturated import Explainable, saturated_mean
from gritd.tools.diagnose.rig.interface import Bools, Index
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import RIDGE, SIZE, SQUARE


def spikes(
    stack: Stack, residual: Array, colours: Sequence[Colour], explainable: Array | None = None
) -> Array:
    """(N,) how far a single value of a residual (N,) stands off its neighbours, where that is
    beyond SPIKE; else 0.

    explainable: columns (N, m). Play in the drive changes a few values after a reversal and little
    else. So what columns that act at such values for the most part can explain is no spike.
    """
    near = median_filter(residual, TUNING.noise.spike_neighbours, mode="nearest")
    off = residual - near
    least = TUNING.noise.spike * np.array([c.sigma for c in colours])[stack.channel]
    spiked = np.abs(off) > least

    if explainable is not None and spiked.any():
        there = explainable[spiked]
        squares = np.sum(explainable**2, axis=0)
        only = 2.0 * np.sum(there**2, axis=0) > np.maximum(squares, SQUARE)
        sudden = there[:, only]
        off[spiked] -= sudden @ np.linalg.lstsq(sudden, off[spiked], rcond=None)[0]
    return np.where(spiked & (np.abs(off) > least), np.abs(off), 0.0)


def uncertain(
    stack: Stack,
    predicted: Array,
    residual: Array,
    colours: Sequence[Colour],
    explainable: Array | None = None,
) -> Array:
    """(N,) what adds to the noise of single values, in their units: blur of the prediction (N,),
    spikes of the residual (N,) that no columns (N, m) explain, and what is left open of the motion.
    """
    off = spikes(stack, residual, colours, explainable)

    return np.hypot(np.hypot(blur_of(stack, predicted), off), stack.motion_sigma)


def first_guess(stack: Stack, predicted: Array) -> Noise:
    """White noise of what a prediction (N,) leaves, from differences between neighbours: a slow
    misfit hardly touches them.
    """
    residual, colours = stack.measured - predicted, []

    for channel in stack.rig.channels:
        inside = stack.of(channel) & np.isfinite(stack.gaps)
        step = np.diff(residual, prepend=0.0)[inside]
        sigma = NORMAL * float(np.median(np.abs(step))) / np.sqrt(2.0) if step.size else 1.0
        colours.append(Colour(max(sigma, _least(stack, channel)), TUNING.noise.slow_times[0], 0.0))

    nothing = np.zeros((stack.size, 0))
    return Noise(stack, tuple(colours), uncertain(stack, predicted, residual, colours), nothing)


def estimate(
    stack: Stack,
    predicted: Array,
    explainable: Explainable,
    before: Noise,
    jobs: int = 1,
) -> Noise:
    """Size and colour of each channel from a rough prediction (N,), and what each run does for
    itself.

    before: a first guess of the noise; jobs: processes.
    """
    residual, cells = stack.measured - predicted, replicates.cells(stack)
    waves = standing(stack, residual, explainable, cells)
    saturated = Explainable(explainable.leading, np.column_stack((explainable.whole, waves)))

    rows = ~stack.idle & ~_speeding(stack)
    found = each(
        jobs,
        lambda channel: _colour_of(stack, channel, residual, saturated, cells, before, rows),
        stack.rig.channels,
    )
    colours, own = tuple(found), replicates.own_columns(stack, residual, found)
    single = uncertain(stack, predicted, residual, colours, explainable.leading)
    noise = Noise(stack, colours, single, own)
    return calmer(noise, residual, saturated, cells, before, stack.idle)


def _speeding(stack: Stack) -> Bools:
    """Values (N,) of what is lost between two torques at which the wheel speeds up or slows down
    more than usual: an inertia acts there, and hardly elsewhere.
    """
    speeding = np.zeros(stack.size, bool)
    if stack.rig.loss_of_drive:
        lost = stack.of("torque") & ~stack.idle
        rate = np.abs(stack.covariate("acceleration"))
        usual = float(np.median(rate[lost])) if lost.any() else 0.0
        speeding[lost] = rate[lost] > TUNING.rig.doubt * NORMAL * usual
    return speeding


def estimate_of_reference(
    stack: Stack,
    predicted: Array,
    residual: Array,
    calm: Array,
    explainable: Explainable,
    before: Noise,
) -> Noise:
    """The same from a reference campaign: all that its residual (N,) shows beside what is
    explainable is what this rig does when nothing is new, waves included.

    predicted: (N,) by the equations; calm: (N,) the residual without ripples, whose single values
    may stand off their neighbours.
    """
    cells = np.full(stack.size, -1, dtype=np.intp)
    rows = ~stack.new & ~stack.idle
    colours = tuple(
        _colour_of(stack, channel, residual, explainable, cells, before, rows)
        for channel in stack.rig.channels
    )

    single = uncertain(stack, predicted, calm, colours, explainable.leading)
    noise = Noise(stack, colours, single, np.zeros((stack.size, 0)))
    return calmer(noise, residual, explainable, cells, before, stack.idle & ~stack.new)


def calmer(
    noise: Noise,
    residual: Array,
    explainable: Explainable,
    cells: Index,
    before: Noise,
    idle: Bools,
) -> Noise:
    """Where the torque is the motor's alone, the noise is that of its current: found from idle
    values (N,), and in force at all of them. They are few and cannot tell a colour: they count for
    no more than by the colour of the channel, nor than by one of their own. A difference of two
    torques is no quieter than the motor's alone.
    """
    stack = noise.stack
    if np.count_nonzero(idle) < 2 * TUNING.noise.cell_values:  # as of two conditions
        return noise
    usual = noise.colours[stack.rig.channels.index("torque")]
    of_idle = stack, "torque", residual, explainable, cells, before, idle
    own, alike = _colour_of(*of_idle), _colour_of(*of_idle, [usual])

    step = step_of(stack.gaps)
    power, least, most = (c.sigma**2 * _slow_power(c, step) for c in (own, alike, usual))
    ratio = float(np.sqrt(max(power, least) / most))
    times = np.where(stack.idle, np.clip(ratio, TUNING.noise.least_noise, 1.0), 1.0)
    return replace(noise, rougher=noise.times * times)


def louder(one: Noise, other: Noise) -> Noise:
    """Of each channel the noise that holds more slow power."""
    step = step_of(one.stack.gaps)
    pairs = list(zip(one.colours, other.colours, strict=True))
    power = [[c.sigma**2 * _slow_power(c, step) for c in pair] for pair in pairs]
    number = [int(np.argmax(both)) for both in power]
    return replace(other, colours=tuple(pair[n] for pair, n in zip(pairs, number, strict=True)))


def restless(noise: Noise, residual: Array) -> Noise:
    """Where a residual (N,) differs from one value to the next by more than the noise does, the
    noise is larger: rough going, a stick and slip, a run of larger forces.

    A reference campaign tells the noise of what it did; what is new may be rougher, and a fit would
    follow its roughness. Slow misfits hardly change such differences.
    """
    stack, louder_by = noise.stack, np.ones(noise.stack.size)
    for channel, number in stack.parts:
        index = np.flatnonzero(stack.of(channel) & (stack.run == number))
        colour = noise.colours[stack.rig.channels.index(channel)]
        louder_by[index] = _restlessness(residual[index], stack.gaps[index], colour)

    return replace(noise, rougher=noise.times * louder_by)


def _restlessness(residual: Array, gaps: Array, colour: Colour) -> Array:
    """By what the noise is larger about each value (n,); 1 where it is hardly larger."""
    if residual.size < TUNING.rig.unrest_values:
        return np.ones(residual.size)
    step = step_of(gaps)
    kept_fast = np.exp(-1.0 / TUNING.noise.fast_time)
    shared = colour.shared(step) * float(np.exp(-step / colour.time)) + colour.fast * kept_fast
    usual = colour.sigma * np.sqrt(2.0 * max(1.0 - shared, TUNING.noise.least_noise))

    differences = np.abs(np.diff(residual, prepend=residual[0]))
    about = median_filter(differences, TUNING.rig.unrest_values, mode="nearest")
    larger = NORMAL * about / usual
    return np.where(larger > TUNING.noise.restless, larger, 1.0)


def _steady(stack: Stack, channel: str, before: Noise) -> Bools:
    """Values of a channel that are hardly noisier than it is; at least half of them."""
    own = stack.of(channel)
    if not own.any():
        return own
    steady: Bools = own & (
        before.loose <= max(TUNING.noise.steady, float(np.median(before.loose[own])))
    )
    return steady


def _colour_of(
    stack: Stack,
    channel: str,
    residual: Array,
    saturated: Explainable,
    cells: Index,
    before: Noise,
    rows: Bools,
    tried: Sequence[Colour] = (),
) -> Colour:
    """Of a channel's noise, by some rows (N,) where they hold any of its steady values: of those
    that are tried, or of all colours, each in its likeliest size.
    """
    own = _steady(stack, channel, before)
    if (own & rows).any():
        own = own & rows
    mean = saturated_mean(residual[own], saturated.leading[own], saturated.whole[own], cells[own])
    columns = np.column_stack((mean, residual[own]))

    tried = tried or colours()
    likelihood, variance = _likelihoods(columns, stack.gaps_of(own), tried)
    posterior = likelihood + log_prior(tried, stack.gaps)
    weight = np.exp(posterior - posterior.max())

    least = _least(stack, channel)
    sized = [
        replace(c, sigma=max(float(np.sqrt(v)), least))
        for c, v in zip(tried, variance, strict=True)
    ]
    return _careful(sized, weight / weight.sum(), step_of(stack.gaps))


def _likelihoods(columns: Array, gaps: Array, tried: Sequence[Colour]) -> tuple[Array, Array]:
    """See `restricted`; columns (n, m + 1), the values last. A few colours at a time: the products
    take memory.
    """
    few = TUNING.numerics.colours_at_once
    parts = [
        restricted(*products_of_innovations(columns, gaps, tried[i : i + few]), len(columns))
        for i in range(0, len(tried), few)
    ]
    likelihood, variance = (np.concatenate(part) for part in zip(*parts, strict=True))
    return likelihood, variance


def colours() -> list[Colour]:
    """All that are tried, of unit size."""
    slow = [
        Colour(1.0, t, w, f * (1.0 - w))
        for t in TUNING.noise.slow_times
        for w in TUNING.noise.slow_shares
        for f in TUNING.noise.fast_shares
    ]
    return slow + [
        Colour(1.0, TUNING.noise.slow_times[0], 0.0, f) for f in TUNING.noise.fast_shares
    ]


def log_prior(tried: Sequence[Colour], gaps: Array) -> Array:
    """Of each colour (g,), up to a constant; gaps (n,) between the values [s]."""
    return np.asarray(
        -TUNING.noise.slow_power * np.log([_slow_power(c, step_of(gaps)) for c in tried])
    )


def _careful(colours: Sequence[Colour], weight: Array, step: float) -> Colour:
    """The colour whose slow power is at quantile CAREFUL of the posterior: few data cannot tell
    slow noise.
    """
    power = np.array([c.sigma**2 * _slow_power(c, step) for c in colours])
    order = np.argsort(power)
    at = int(np.searchsorted(np.cumsum(weight[order]), TUNING.noise.careful))
    return colours[int(order[min(at, len(colours) - 1)])]


def _slow_power(colour: Colour, step: float) -> float:
    """Spectral density towards zero frequency, relative to that of white noise of the same
    variance.
    """
    return 1.0 - colour.slow + 2.0 * colour.slow * colour.time / step


def restricted(gram: Array, log_det: Array, count: int) -> tuple[Array, Array]:
    """Restricted log-likelihood (g,) of each colour with the size maximised out, and variance (g,).

    gram: (g, m + 1, m + 1) products of the whitened columns of the mean, and of the values last; of
        so many values.
    """
    inner, size = gram[:, :-1, :-1], gram.shape[1] - 1
    scale = np.trace(inner, axis1=1, axis2=2)[:, None, None] / max(size, 1)
    inner = inner + RIDGE * scale * np.eye(size)

    root = np.linalg.cholesky(inner)
    taken = np.linalg.solve(root, gram[:, :-1, -1:])[:, :, 0]
    free = max(count - size, 1)

    variance = np.maximum(gram[:, -1, -1] - np.sum(taken**2, axis=1), SQUARE) / free
    spread = 2.0 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    return -0.5 * (free * np.log(variance) + log_det + spread), variance


def _least(stack: Stack, channel: str) -> float:
    """A noise no channel is below. Noise-free simulations still need a scale: the channel's size,
    or that of what it is the difference of.
    """
    values = stack.measured[stack.of(channel)]
    if not values.size:
        return 1.0
    of = [s.size for s in stack.rig.forms if s.size is not None and channel in s.channels]
    return TUNING.noise.floor * max([float(np.sqrt(np.mean(values**2))), *of]) + SIZE
