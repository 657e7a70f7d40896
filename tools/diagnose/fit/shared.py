"""What the rig did already: the library's own effects in both campaigns, as a term of the fit.

With a reference campaign an effect is named for what is new. A rig of which the reference shows a
gear's ripple, a sidewall that rubs or soil that relaxes has these in the new campaign too, and no
explanation of the reference is asked for. So every effect of the library may act in both campaigns
with one strength,

    Σₑ aₑ Sₑ(x),   aₑ ~ N(0, 1) in expected sizes, times a size that is learnt,

linear about the rough fit, reduced to the directions that the recordings can show. The drive, the
soil, the instruments, and what changes with time or place have a size each: a gear that rubs much
says nothing of the soil, and soil that shears otherwise says nothing of soil that dries. A ripple
keeps its order and its size, but not its phase: each stretch at a steady speed has its own, as the
grid has it (orders/on_grid.py), for drives yield and stamps are late. A run of larger forces or
torques may ripple more in proportion, as a gear does. Soil and rim forget over a length of travel:
what a channel lacks where it follows the prediction is a sum over lengths a factor of three apart,
as any memory that fades nearly is. What a run begins with, before soil is sheared and heaped under
a wheel that was set down, is another in each run too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from gritd.estimator.effects.base import Effect, order_of
from gritd.estimator.model.discrepancy import CONDITIONS, START, TRAVELS
from gritd.estimator.stages.history import followed
from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.discrepancy import conditions_at, form_sizes, joined, scale_of
from gritd.tools.diagnose.fit.functions import BEYOND_FORM
from gritd.tools.diagnose.fit.marginal import Chosen
from gritd.tools.diagnose.fit.random_effect import RandomEffect, Sizes, even, random_effect
from gritd.tools.diagnose.fit.ripples import line_waves
from gritd.tools.diagnose.fit.signatures import raw_signatures
from gritd.tools.diagnose.noise.colour import Noise, whiten
from gritd.tools.diagnose.orders.lines import SpectralLine
from gritd.tools.diagnose.orders.stretches import GridMotion, Ints, nearest, stretches
from gritd.tools.diagnose.rig.interface import HAD, Index
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN, SQUARE

CHANGES = "changes"  # what varies with time, heat, place or run
STARTS = "starts"  # what a run begins with
MEMORY = "memory"  # of what was a while ago
# what all other effects are of, and their stages
PARTS = {
    CHANGES: (),
    "drive": ("drivetrain",),
    "soil": ("soil", "contact", "wheel"),
    "instruments": ("sensor", "testbed", "any"),
}


def shared_columns(stack: Stack, u: Array, predicted: Array) -> dict[str, Array]:
    """Signatures (N, m) of all effects but ripples in both campaigns, about a prediction (N,) at
    constants u (q,), by what they are effects of; each effect of one expected size together.
    """
    had = {constant.parameter[0] for constant in stack.rig.constants if constant.kind == HAD}
    every = stack.rig.effects.items()
    names = [name for name, effect in every if order_of(effect) is None and name not in had]
    columns: dict[str, list[Array]] = {part: [np.zeros((stack.size, 0))] for part in PARTS}
    for name in names:
        each = list(raw_signatures(stack, u, predicted, [name], everywhere=True))
        own = columns[_part_of(stack.rig.effects[name])]
        own += [s.columns / np.sqrt(len(each)) for s in each]
    return {part: np.column_stack(each) for part, each in columns.items()} | {
        STARTS: _starts(stack),
        MEMORY: _memory(stack, predicted),
    }


def _memory(stack: Stack, predicted: Array) -> Array:
    """What each channel lacks where it follows a prediction (N,) over lengths of the rim's or the
    axle's way, in m or in contact lengths (N, m).
    """
    direction, columns = stack.covariate("direction"), [np.zeros((stack.size, 0))]
    for source in (source for source in stack.rig.forms if not source.drive):
        ways = [joined(stack, [run[:, k] for run in source.ways]) for k in range(4)]
        known = [way for way in ways if way.any()]  # a steady state has no place
        for channel, way, length in product(source.channels, known, TRAVELS):
            own = np.flatnonzero(stack.of(channel))
            share = -np.expm1(-np.abs(np.diff(way[own], prepend=0.0)) / length)
            follow = partial(followed, share=share, run=stack.run[own].astype(float))
            turn = direction[own] if source.signed else None
            behind = np.zeros((stack.size, 2 if source.signed else 1))
            behind[own] = _behind(predicted[own], turn, follow)
            columns.append(behind)
    return np.column_stack(columns)


def _behind(values: Array, turn: Array | None, follow: Callable[[Array], Array]) -> Array:
    """What values (n,) lack where they follow themselves (n, k). With a direction (n,) that they
    turn with: as they are, and in a size that lasts through rest and reversal.
    """
    if turn is None:
        return (follow(values) - values)[:, None]
    moving = np.abs(turn)
    return np.column_stack(
        (moving * (follow(values) - values), turn * follow(turn * values) - moving * values)
    )


def _starts(stack: Stack) -> Array:
    """What each run begins with (N, s), in proportion to its forces, of every run its own."""
    columns = [np.zeros((stack.size, 0))]
    runs = stack.run[:, None] == np.arange(len(stack.rig.runs))
    for source in stack.rig.forms:
        if not source.drive:
            left = START * conditions_at(stack, source)[:, CONDITIONS.index("start")]
            columns.append(np.where(runs, (left * scale_of(stack, source))[:, None], 0.0))
    return np.column_stack(columns)


def _part_of(effect: type[Effect]) -> str:
    if effect.fingerprint.covariate in BEYOND_FORM:
        return CHANGES
    return next(part for part, stages in PARTS.items() if effect.stage in stages)


def rippling_columns(stack: Stack) -> Array:
    """Cosine and sine (N, m) of the ripples that the reference's readings show at their own rate,
    of the size that they have there; of every channel its own, in every stretch of ripples that
    stand out there, else in every run.
    """
    lines = stack.rig.lines
    waves: dict[tuple[int, float], list[tuple[SpectralLine, Index, Array]]] = {}
    for line, index, wave in line_waves(stack, lines.shared):
        of = (int(stack.channel[index[0]]), line.at)
        waves.setdefault(of, []).append((line, index, wave))

    columns = [np.zeros((stack.size, 0))]
    for runs in waves.values():
        known = [index for _, index, _ in runs if not stack.new[index[0]]]
        if known:
            usual = _level(stack, known)
            for line, index, wave in runs:
                largest = lines.before(line) * max(_level(stack, [index]) / usual, 1.0) * wave
                stretch = _stretches(stack, index) if lines.found(line) else 0 * index
                for number in np.unique(stretch):
                    own = np.zeros((stack.size, 2))
                    own[index] = np.where((stretch == number)[:, None], largest, 0.0)
                    columns.append(own)
    return np.column_stack(columns)


def _stretches(stack: Stack, index: Index) -> Ints:
    """Number of the stretch (n,) at a steady speed that is nearest to each value of one run."""
    run = stack.rig.runs[int(stack.run[index[0]])]
    known = run.covariates
    rim = known["direction"] * known["speed"]
    motion = GridMotion(run.time, rim, rim * (1.0 - known["slip"]), known["load"])
    return nearest(stack.time[index], *stretches(motion))


def without_ripples(stack: Stack, residual: Array, ripples: Array) -> Array:
    """A residual (N,) less what ripples (N, r) can be of it, as its differences from one value to
    the next tell: a slow misfit hardly changes them. In each run and channel for itself. Good for
    such differences alone: a long wave is hardly known by them.
    """
    left = residual.copy()
    for channel, number in stack.parts:
        index = np.flatnonzero(stack.of(channel) & (stack.run == number))
        own = ripples[index][:, np.any(ripples[index], axis=0)]
        if own.shape[1]:
            left[index] -= own @ _least_absolute(np.diff(own, axis=0), np.diff(residual[index]))
    return left


def _least_absolute(columns: Array, values: Array) -> Array:
    """Weights (m,) of columns (n, m) by which they leave the least sum of absolute values of (n,):
    a change of slip is a few large differences. Iteratively weighted squares.
    """
    weights: Array = np.ones(values.size)
    share: Array = np.zeros(columns.shape[1])
    for _ in range(TUNING.numerics.calming_rounds):
        root = np.sqrt(weights)
        share = np.asarray(np.linalg.lstsq(root[:, None] * columns, root * values, rcond=None)[0])
        off = np.abs(values - columns @ share)
        weights = 1.0 / np.maximum(off, max(float(np.median(off)), SQUARE))
    return share


def shared_terms(
    noise: Noise, shared: Mapping[str, Array], ripples: Array
) -> tuple[RandomEffect, ...]:
    """Terms of the effects (N, m) by what they are of, and the ripples (N, r)."""
    sizes = {part: even(TUNING.fit.shared_sizes) for part in shared} | {STARTS: form_sizes()}
    terms = [
        random_effect(_name(part), _reduced(columns, whiten(noise, columns)), noise, sizes[part])
        for part, columns in shared.items()
    ]
    terms.append(random_effect("ripples in both", ripples, noise, Sizes()))
    return tuple(f for f in terms if f.columns.count)


def lasting(terms: Sequence[RandomEffect], sizes: Chosen) -> tuple[RandomEffect, ...]:
    """The terms with what varies with time, heat, place or run, what runs begin with, and memory no
    larger than in the reference. Where nothing dried, crept or lagged then, it is news now.
    """
    passing = (_name(CHANGES), _name(STARTS), _name(MEMORY))
    return tuple(
        replace(f, sizes=f.sizes.up_to(number)) if f.name in passing else f
        for f, number in zip(terms, sizes, strict=True)
    )


def _name(part: str) -> str:
    return f"{part} in both"


def _reduced(columns: Array, whitened: Array) -> Array:
    """Combinations of columns with the same covariance, the largest first; without those that
    are less than the noise altogether.
    """
    if not columns.shape[1]:
        return columns
    values, vectors = np.linalg.eigh(whitened.T @ whitened)
    large = np.flatnonzero(values > TUNING.numerics.shared_least)[::-1][
        : TUNING.numerics.shared_most
    ]
    return np.asarray(columns @ vectors[:, large])


def _level(stack: Stack, parts: Sequence[Index]) -> float:
    """Root mean square of what was measured."""
    values = stack.measured[np.concatenate(parts)]
    return max(float(np.sqrt(np.mean(values**2))), SPAN)
