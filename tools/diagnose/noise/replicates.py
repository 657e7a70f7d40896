"""Conditions that were held, and held again: what varies inside a condition is noise, whatever
the model.

A cell is a set of values at nearly the same covariates. Means of cells belong to the saturated
model, so that a misfit of any shape over the conditions does not count as noise. Runs that held
the same condition on equal terms (same pass, same start) are replicates: what their means and their
drifts differ by, beyond the noise inside a run, is pure error between runs. A bed that is not
level, say, lets the sinkage of each trial drift its own way. A drift that replicates share (a soil
that dries, a motor that warms) is none: it stays in full, to be explained.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from scipy.special import chdtrc

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.noise.colour import Colour, covariance
from gritd.tools.diagnose.rig.interface import Bools, Index
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN, WAY


def cells(stack: Stack) -> Index:
    """Number of the cell of each value (N,); −1 where the wheel rests or little was held."""
    coarser = 1.0
    while (label := _labels(stack, coarser)).max(initial=-1) >= TUNING.noise.most_cells:
        coarser *= 2.0
    return label


def _labels(stack: Stack, coarser: float) -> Index:
    keys = [stack.channel, (stack.covariate("speed") > 0.0).astype(int)]
    keys += [_binned(values) for values in (_conditions(stack) / coarser).T]
    table = np.column_stack(keys)
    conditions, label = np.unique(table[:, 1:], axis=0, return_inverse=True)
    label = label.ravel()
    count = np.bincount(label) / max(len(stack.rig.channels), 1)
    kept = (count >= TUNING.noise.cell_values) & (conditions[:, 0] > 0)
    renamed = np.where(kept, np.cumsum(kept) - 1, -1)
    return np.asarray(renamed[label], dtype=np.intp)


def _conditions(stack: Stack) -> Array:
    """What was held at each value, in widths of a cell (N, m)."""
    columns = [np.where(stack.new, 1.0, 0.0)]
    for name, width in TUNING.noise.cell_widths.items():
        if name in stack.rig.runs[0].covariates:
            values = stack.covariate(name)
            # a ratio has no scale of its own
            ratio = stack.rig.units[name] == "-"
            largest = 1.0 if ratio else max(float(np.abs(values).max()), SPAN)
            columns.append(values / (width * largest))
    return np.column_stack(columns)


def _binned(values: Array) -> Index:
    """Whole numbers, in the phase that makes the fullest bins: what was held shall not fall on
    an edge.
    """
    tried = [np.floor(values + phase).astype(int) for phase in TUNING.noise.cell_phases]
    counts = [np.unique(bins, return_counts=True)[1].astype(float) for bins in tried]
    return tried[int(np.argmax([np.sum(count**2) for count in counts]))]


def repeats(stack: Stack) -> Index:
    """How many runs (runs,) held the same conditions as each, and as long, itself counted."""
    label = cells(stack)
    in_cells = label >= 0
    held = np.zeros((len(stack.rig.runs), int(label.max(initial=-1)) + 1))
    np.add.at(held, (stack.run[in_cells], label[in_cells]), 1.0)

    together = np.minimum(held[:, None], held).sum(axis=2)
    whole = held.sum(axis=1)
    alike = together > TUNING.noise.mostly * np.maximum.outer(whole, whole)
    return np.asarray((alike | np.eye(len(held), dtype=bool)).sum(axis=1))


class HeldCondition(NamedTuple):
    """What one run did while it held a condition."""

    run: int
    condition: Array  # mean slip, speed and load, in widths of a cell
    # (m,) of the residual: coefficients of what a run may do for itself; NaN where not known
    shape: Array
    chance: Array  # (m,) their variance by noise


def own_columns(stack: Stack, residual: Array, colours: Sequence[Colour]) -> Array:
    """What each run may do for itself (N, m), one standard deviation each, as large as
    replicates show it in what was not predicted, `residual` (N,): an offset; and, of a run that
    held one condition, drifts.
    """
    label, terms, columns = cells(stack), _terms(stack), []
    for number, colour in enumerate(colours):
        sigma = between_runs(list(_held(stack, residual, label, number, colour)), terms)

        for run in range(len(stack.rig.runs)) if sigma.any() else ():
            own = _driven(stack, number, run)
            shapes = np.zeros((stack.size, len(sigma)))
            shapes[own] = sigma * _shapes(stack.time[own]) if own.any() else 0.0
            columns += list(shapes[:, : None if _one_condition(own, label) else 1].T)

    used = (column for column in columns if column.any())
    return np.column_stack([np.zeros((stack.size, 0)), *used])


def between_runs(held: list[HeldCondition], terms: Array) -> Array:
    """Standard deviations between replicates beyond the noise inside a run (m,); 0 where
    nothing was repeated.

    Of what one channel did while conditions were held. From successive differences (von Neumann
    1941), so that what changes steadily from run to run does not count. terms: pass and start of
    each run (runs, 2).
    """
    pairs = [(one, two) for one in held if (two := _next(one, held, terms)) is not None]
    return _spread([(two.shape - one.shape, one.chance + two.chance) for one, two in pairs])


def _held(
    stack: Stack, residual: Array, label: Index, number: int, colour: Colour
) -> Iterator[HeldCondition]:
    """Every condition that every run held, in one channel, run after run."""
    conditions = _conditions(stack)
    for run in range(len(stack.rig.runs)):
        own = _driven(stack, number, run)
        only = _one_condition(own, label)
        held = [own & (label == cell) for cell in np.unique(label[own & (label >= 0)])]

        for mask in (m for m in ([own] if only else held) if m.sum() >= TUNING.noise.cell_values):
            inverse = np.linalg.pinv(_shapes(stack.time[mask])[:, : None if only else 1])
            noise = covariance(colour, stack.time[mask], stack.gaps[mask])
            shape, chance = np.full((2, TUNING.noise.drift_shapes), np.nan)
            shape[: len(inverse)] = inverse @ residual[mask]
            chance[: len(inverse)] = np.diag(inverse @ noise @ inverse.T)
            yield HeldCondition(run, conditions[mask].mean(axis=0), shape, chance)


def _driven(stack: Stack, number: int, run: int) -> Bools:
    return np.asarray(
        (stack.channel == number) & (stack.run == run) & (stack.covariate("speed") > 0.0)
    )


def _one_condition(own: Bools, label: Index) -> bool:
    """Whether a run, of values `own`, held one condition, long enough to tell how it drifted
    meanwhile.
    """
    most = int(np.bincount(label[own] + 1)[1:].max(initial=0))
    least = TUNING.noise.cell_values * TUNING.noise.drift_shapes
    return bool(most >= max(least, TUNING.noise.mostly * own.sum()))


def _next(one: HeldCondition, held: list[HeldCondition], terms: Array) -> HeldCondition | None:
    """The next run that held the same condition on equal terms."""

    def apart(two: HeldCondition) -> float:
        return float(np.abs(two.condition - one.condition).max())

    later = [two for two in held if two.run > one.run and apart(two) <= 1.0]
    alike = [two for two in later if np.abs(terms[two.run] - terms[one.run]).max() <= WAY]
    return min(alike, key=lambda two: (two.run, apart(two)), default=None)


def _shapes(time: Array) -> Array:
    """What a run may do for itself (n, m): Legendre polynomials over a stretch of time."""
    along = 2.0 * (time - time.min()) / max(float(np.ptp(time)), SPAN) - 1.0
    return legendre.legvander(along, TUNING.noise.drift_shapes - 1)


def _spread(differences: list[tuple[Array, Array]]) -> Array:
    """Standard deviations (m,), from differences and what variance noise alone gives them, (m,)
    each.

    Of means what exceeds the noise; of drifts too, where noise alone makes so much in few cases
    only.
    """
    count = TUNING.noise.drift_shapes
    out = np.zeros(count)
    every = np.array(differences).reshape(-1, 2, count).transpose(2, 1, 0)
    for order, (difference, chance) in enumerate(every):
        known = np.isfinite(difference)
        squares, chance = difference[known] ** 2, chance[known]
        if squares.size >= TUNING.noise.least_pairs:
            rare = chdtrc(squares.size, float(np.sum(squares / chance))) < TUNING.screen.level
            if order == 0 or rare:
                # variance of Student's t: known from few differences, it must be taken larger
                few = (squares.size + 2.0) / squares.size
                out[order] = np.sqrt(few * max(0.5 * float(np.mean(squares - chance)), 0.0))

    return out


def _terms(stack: Stack) -> Array:
    """Pass, start and campaign of each run (runs, 3): on other terms a repetition is no
    replicate.
    """
    known = [run.covariates for run in stack.rig.runs]
    passes = [of["pass"][0] if "pass" in of else 0.0 for of in known]
    starts = [of["position"][0] for of in known]
    return np.column_stack((passes, starts, np.array(stack.rig.new, dtype=float)))
