"""Misfits without a name that must be searched for: waves (lines.py) and steps, in time and along
the bed.

A family is one channel along one axis, with a wave at every frequency that the grid shows, or a
step at every place. Its evidence is the average over all of them, so that the number of frequencies
and places tried is paid for. Cosine and sine of a wave are of one size and at a right angle to each
other; so are those of one stretch to another's: what this leaves out is small. Where a wave's
neighbours in the spectrum hold more than the noise that is assumed, its power counts by so much
less: a line stands out of what is near it, whatever the colour.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import digamma

from gritd.estimator.effects.base import order_of
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import (
    Signature,
    log_bayes_alone,
    log_sum,
    strength_sizes,
)
from gritd.tools.diagnose.fit.functions import size_of
from gritd.tools.diagnose.fit.problem import Fitted, Problem
from gritd.tools.diagnose.fit.projection import Projection, WhitenedBlock
from gritd.tools.diagnose.fit.ripples import line_columns, orders_shown
from gritd.tools.diagnose.fit.shape import Shape
from gritd.tools.diagnose.noise import lines
from gritd.tools.diagnose.noise.colour import Noise, whiten
from gritd.tools.diagnose.orders.wave import pair
from gritd.tools.diagnose.rig.interface import Bools, Index
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SIZE, SPAN


@dataclass(frozen=True, eq=False)
class Family:
    """A channel's waves or steps along an axis.

    at:     frequencies [1/s, 1/m, 1/rad] or places [s, m, …] (f,).
    blocks: values whose shapes have coefficients of their own; their columns are (n, f · c), c for
            each of `at`.
    near:   of waves, (f, f) 1 for neighbours in the spectrum.
    """

    shape: Shape
    at: Array
    blocks: tuple[WhitenedBlock, ...]
    near: Array | None = None

    @property
    def axis(self) -> str:
        return self.shape.along[0]

    @property
    def phases(self) -> tuple[bool, ...]:
        """Whether all blocks have one coefficient: of waves along the bed it is not known, of
        others never.
        """
        if len(self.blocks) == 1 or self.axis == "wheel_angle":
            return (True,)
        return (False, True) if self.axis == "position" else (False,)

    def evidence(self, beside: Projection, near: Array | None = None) -> Array:
        """Log Bayes factor (p, f) of every shape, p phases, beside a model; with neighbours, by
        what it stands out of them.
        """
        projected = [beside.project_block(block) for block in self.blocks]
        return np.stack([_weighed(projected, self.at.size, one, near) for one in self.phases])

    def average(self, beside: Projection) -> float:
        """Log Bayes factor of the family."""
        every = self.evidence(beside, self.near)
        return float(log_sum(every.ravel()) - np.log(every.size))


def _weighed(
    projected: Sequence[tuple[Array, Array, Array]], count: int, shared: bool, near: Array | None
) -> Array:
    """Log Bayes factor (count,) from squares, coordinates and scores of every block."""
    if shared:
        squares, inside, b = (np.sum([f[i] for f in projected], axis=0) for i in range(3))
        projected = [(squares, inside, b)]

    width = projected[0][0].size // count
    sizes = [
        np.maximum(s - np.sum(i**2, axis=0), 0.0).reshape(count, width).mean(axis=1)
        for s, i, _ in projected
    ]
    powers = [np.sum(b.reshape(count, width) ** 2, axis=1) for _, _, b in projected]

    level = 1.0 if near is None else _level(sizes, powers, near)

    scales = strength_sizes()[:, None]
    parts = np.zeros((len(scales), count))
    for size, power in zip(sizes, powers, strict=True):
        parts += 0.5 * power / level / (size + scales**-2)
        parts -= 0.5 * width * np.log1p(scales**2 * size)
    return np.asarray(log_sum(parts) - np.log(len(scales)))


def _level(sizes: list[Array], powers: list[Array], near: Array) -> Array:
    """Geometric mean (f,) of the neighbours' power, in that of the noise; 1 at least."""
    ratio = np.sum(
        [power / np.maximum(size, SIZE) for size, power in zip(sizes, powers, strict=True)], axis=0
    )
    expected = digamma(len(sizes)) + np.log(2.0)  # of the logarithm of a χ² of two degrees each
    share = near / np.maximum(near.sum(axis=1, keepdims=True), 1.0)
    return np.asarray(np.exp(np.maximum(share @ (np.log(np.maximum(ratio, SIZE)) - expected), 0.0)))


# ---- what is searched --------------------------------------------------------------------------


def families(stack: Stack, noise: Noise, acting: Bools | None = None) -> tuple[Family, ...]:
    """Of every channel, on the values (N,) where they may act: those that may hold something new,
    unless others are given.
    """
    acting = stack.new if acting is None else acting
    searched = []

    for channel in stack.rig.channels:
        for axis in lines.axes_of(stack):
            every = lines.frequencies(stack, channel, axis)
            searched.append(waves(stack, noise, channel, axis, every, acting))
            if axis != "sliding":
                searched.append(steps(stack, noise, channel, axis, acting))

    return tuple(family for family in searched if family.blocks)


def more_families(stack: Stack, noise: Noise) -> tuple[Family, ...]:
    """Where else a misfit may live: ripples of the wheel, steps along slip and between runs."""
    searched, known = [], stack.rig.runs[0].covariates
    runs = () if stack.rig.tabled else ("run",)  # rows of a table have no order
    for channel in stack.rig.channels:
        turning = orders_shown(stack, 1.0) / (2.0 * np.pi)
        searched.append(waves(stack, noise, channel, "wheel_angle", turning, stack.new))
        for axis in ("slip", *runs) if "slip" in known else runs:
            searched.append(steps(stack, noise, channel, axis, stack.new))

    return tuple(family for family in searched if family.blocks)


def waves(
    stack: Stack, noise: Noise, channel: str, axis: str, frequencies: Array, acting: Bools
) -> Family:
    """Waves of some frequencies (f,) [1/s, 1/m] on the values (N,) where they may act."""
    size, x = np.sqrt(2.0) * size_of(stack, channel), stack.covariate(axis)
    blocks = []
    stretches = _stretches(stack, channel, acting)
    for index in stretches if frequencies.size else ():
        rows = noise.touched(int(index[0]), int(index[-1]) + 1)
        raw = np.zeros((rows.stop - rows.start, frequencies.size, 2))
        raw[index - rows.start] = size * pair(x[index], frequencies)
        blocks.append(_block(noise, rows, raw))

    near = lines.neighbours(x, stretches, frequencies) if blocks else None
    return Family(Shape(channel, (axis,), "wave"), frequencies, tuple(blocks), near)


def _stretches(stack: Stack, channel: str, acting: Bools) -> list[Index]:
    """Those of the marked values (N,)."""
    return [index for index in lines.stretches(stack, channel) if acting[index[0]]]


def steps(stack: Stack, noise: Noise, channel: str, axis: str, acting: Bools) -> Family:
    """Steps wherever there may be one, on the values (N,) where they may act."""
    shape, at = Shape(channel, (axis,), "step"), places(stack, channel, axis)
    if not at.size:
        return Family(shape, at, ())
    rows = _rows(stack.of(channel))

    raw = size_of(stack, channel) * _risen(stack, rows, axis, at, acting)[:, :, None]
    return Family(shape, at, (_block(noise, rows, raw),))


def places(stack: Stack, channel: str, axis: str) -> Array:
    """Where a step may be [s, m, …] (p,): between two runs, or as many values between two as
    between others, some on either side of all.
    """
    own = stack.of(channel) & (stack.covariate("speed") > 0.0)
    x = stack.covariate(axis)[own]
    if x.size < 2 * TUNING.noise.cell_values or np.ptp(x) <= SPAN:
        return np.zeros(0)
    if axis == "run":
        return np.arange(x.min(), x.max()) + 0.5

    ordered, least = np.sort(x), TUNING.noise.cell_values
    beyond = np.linspace(least, x.size - least, TUNING.screen.step_places).astype(int)
    return np.unique(0.5 * (ordered[beyond - 1] + ordered[beyond]))


def _risen(stack: Stack, rows: slice, axis: str, at: Array, acting: Bools) -> Array:
    """(n, p) from 0 to 1 at each place while the wheel moves, on the values that may act."""
    x, moving = stack.covariate(axis)[rows], (stack.covariate("speed") > 0.0)[rows]
    where = (moving & acting[rows])[:, None]
    span = {"time": TUNING.noise.stretch, "run": 1.0}.get(axis) or float(np.ptp(x[moving]))
    width = TUNING.screen.step_width * span
    return np.asarray(np.where(where, 0.5 * (1.0 + np.tanh((x[:, None] - at) / width)), 0.0))


def _rows(own: Bools) -> slice:
    index = np.flatnonzero(own)
    return slice(int(index[0]), int(index[-1]) + 1)


def _block(noise: Noise, rows: slice, raw: Array) -> WhitenedBlock:
    white = np.asarray(noise.whitener[rows, rows] @ raw.reshape(len(raw), -1))
    return WhitenedBlock(rows, white.astype(np.float32))


# ---- those that stand out ----------------------------------------------------------------------


def candidates(search: Sequence[Family], problem: Problem, beside: Projection) -> list[Signature]:
    """The likeliest shapes of every family beside a model, each with its log share among all that
    were tried.
    """
    return [peak for family in search for peak in _peaks(family, problem, beside)]


def _peaks(family: Family, problem: Problem, beside: Projection) -> Iterator[Signature]:
    every = family.evidence(beside)
    share = -float(np.log(every.size))
    best = every.max(axis=0)
    edged = np.pad(best, 1, constant_values=-np.inf)
    highest = (best >= edged[:-2]) & (best > edged[2:])
    top = np.flatnonzero(highest & (best + share > 0.0))

    for place in top[np.argsort(-best[top])][: TUNING.search.again]:
        shared = family.phases[int(np.argmax(every[:, place]))]
        wave = family.shape.kind == "wave"
        at = float(family.at[place])
        if wave and family.axis != "wheel_angle":
            at = _refined(family, problem, beside, int(place), shared)
        yield _signature(problem.stack, replace(family.shape, at=at, shared=shared), share)


def windows(search: Sequence[Family], problem: Problem, beside: Projection) -> Iterator[Signature]:
    """The likeliest stretch between two steps of every family of steps beside a model, with its log
    share among all that were tried.
    """
    for family in search:
        if family.shape.kind != "step" or family.at.size < 2:
            continue
        columns = family.blocks[0].columns.astype(float)
        _, inside, b = beside.project_block(family.blocks[0])
        a = columns.T @ columns - inside.T @ inside
        i, j = np.triu_indices(family.at.size, 1)
        value = log_bayes_alone(a[i, i] + a[j, j] - 2.0 * a[i, j], b[i] - b[j])
        best, share = int(np.argmax(value)), -float(np.log(value.size))
        if value[best] + share > 0.0:
            first, last = (float(family.at[k[best]]) for k in (i, j))
            shape = replace(family.shape, kind="window", at=first, until=last)
            yield _signature(problem.stack, shape, share)


def _refined(
    family: Family, problem: Problem, beside: Projection, place: int, shared: bool
) -> float:
    """The best frequency between two of the scan."""
    steps_near = np.linspace(-1.0, 1.0, TUNING.numerics.frequencies_near_best)
    near = family.at[place] + float(np.ptp(family.at[:2])) * steps_near
    stack = problem.stack
    finer = waves(stack, problem.noise, family.shape.channel, family.axis, near, stack.new)
    best = finer.evidence(beside)[finer.phases.index(shared)]
    return float(near[int(np.argmax(best))])


def _signature(stack: Stack, shape: Shape, prior: float) -> Signature:
    columns = shape_columns(stack, shape)
    return Signature(shape, columns, (0,) * columns.shape[1], {}, prior)


def shape_columns(stack: Stack, shape: Shape) -> Array:
    """One wave, step or window (N, m), of the expected size of a misfit; of a wave two columns, or
    two a stretch.
    """
    assert shape.at is not None
    (axis,) = shape.along
    size = size_of(stack, shape.channel)
    if shape.kind != "wave":
        rows, out = _rows(stack.of(shape.channel)), np.zeros((stack.size, 1))
        risen = size * _risen(stack, rows, axis, np.array(shape.places), stack.new)
        out[rows] = risen[:, :1] - risen[:, 1:].sum(axis=1, keepdims=True)
        return out

    parts = _stretches(stack, shape.channel, stack.new)
    parts = [np.concatenate(parts)] if shape.shared else parts
    out = np.zeros((stack.size, 2 * len(parts)))
    for number, index in enumerate(parts):
        wave = pair(stack.covariate(axis)[index], shape.at)
        out[index, 2 * number : 2 * number + 2] = np.sqrt(2.0) * size * wave
    return out


def without_harmonics(problem: Problem, fitted: Fitted) -> Projection:
    """The neighbourhood of a fit; where it holds a ripple of the wheel, its harmonics too, and
    ripples of the recordings that are too fast for the grid.

    At a steady speed they are waves in time and along the bed, and another published form of the
    ripple has them.
    """
    projection, columns = fitted.projection(), list(_harmonics(problem.stack, fitted))
    if not columns:
        return projection

    return projection.with_columns(whiten(problem.noise, np.column_stack(columns)))


def _harmonics(stack: Stack, fitted: Fitted) -> Iterator[Array]:
    """Also ripples that are too fast for the grid: there they would pass for slow waves."""
    for column in line_columns(stack, unheld=True).T:
        sizes = [size_of(stack, channel) for channel in stack.rig.channels]
        yield TUNING.fit.strength_prior * np.array(sizes)[stack.channel] * column

    for effect in fitted.acting:
        if effect.fingerprint.covariate == "wheel_angle":
            name = order_of(type(effect))
            phase = stack.covariate("wheel_angle") * (getattr(effect, name) if name else 1.0)

            for channel in stack.rig.channels:
                own = stack.of(channel) & (stack.covariate("speed") > 0.0)
                for number in range(1, TUNING.fit.harmonics + 1):
                    for wave in (np.cos, np.sin):
                        large = TUNING.fit.strength_prior * size_of(stack, channel)
                        yield np.where(own, large * wave(number * phase), 0.0)
