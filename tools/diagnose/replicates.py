"""Conditions that were held, and held again: what varies inside a condition is noise, whatever the model.

A cell is a set of values at nearly the same covariates. Means of cells belong to the saturated model, so that a misfit
of any shape over the conditions does not count as noise. Runs that share a cell on equal terms (same pass, same start)
are replicates: what their means and their drifts differ by, beyond the noise inside a run, is pure error between runs.
A bed that is not level, say, lets the sinkage of each trial wander its own way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre
from scipy.stats import chi2

from estimator.terramechanics.soil import Array
from tools.diagnose.noise import Colour, covariance
from tools.diagnose.rig import Bools, Index, Stack

WIDTHS = {"slip": 0.04, "speed": 0.08, "load": 0.05}  # of a cell; of speed and load relative to their largest
FEW, MANY = 10, 60  # values a cell must hold; cells a channel may have
EQUAL = 1e-3  # difference of pass or start at which two runs are no replicates
SAME = 0.02  # relative distance at which weights are others
PAIRS = 2  # comparisons of replicates at least
SHAPES, LONG = 4, 40  # of what a run does in a cell: a mean and three of drift; values that drifts need
RARE = 0.01  # probability by which noise alone may make drifts differ as they do
PHASES = (0.5, 0.75, 0.0, 0.25)  # of the edges of cells


def cells(stack: Stack) -> Index:
    """Number of the cell of each value (N,); −1 where the wheel rests or hardly anything was held."""
    names = [n for n in WIDTHS if n in stack.rig.runs[0].covariates]
    for coarser in (1.0, 2.0, 4.0):
        label = _labels(stack, names, coarser)
        if label.max(initial=-1) < MANY:
            break
    return label


def _labels(stack: Stack, names: list[str], coarser: float) -> Index:
    keys = [stack.channel, (stack.covariate("speed") > 0.0).astype(int)]
    for name in names:
        values = stack.covariate(name)
        width = WIDTHS[name] * coarser * (1.0 if name == "slip" else max(float(np.abs(values).max()), 1e-9))
        keys.append(_binned(values / width))
    table = np.column_stack(keys)
    conditions, label = np.unique(table[:, 1:], axis=0, return_inverse=True)
    label = label.ravel()
    count = np.bincount(label) / max(len(stack.rig.channels), 1)
    kept = (count >= FEW) & (conditions[:, 0] > 0)
    renamed = np.where(kept, np.cumsum(kept) - 1, -1)
    return np.asarray(renamed[label], dtype=np.intp)


def _binned(values: Array) -> Index:
    """Whole numbers, in the phase that makes the fullest bins: what was held shall not fall on an edge."""
    tried = [np.floor(values + phase).astype(int) for phase in PHASES]
    return max(tried, key=lambda bins: float(np.sum(np.unique(bins, return_counts=True)[1].astype(float) ** 2)))


def between_runs(stack: Stack, residual: Array, colours: tuple[Colour, ...]) -> Array:
    """Standard deviations between replicates beyond the noise inside a run (channels, SHAPES); 0 where nothing was
    repeated.

    Of the mean in a cell and of its drift there, as coefficients of Legendre polynomials of time. From successive
    differences (von Neumann 1941), so that a drift from run to run does not count.
    """
    label, terms = cells(stack), _terms(stack)
    out = np.zeros((len(stack.rig.channels), SHAPES))
    for number, colour in enumerate(colours):
        found: list[Array] = []
        for cell in range(int(label.max(initial=-1)) + 1):
            own = (label == cell) & (stack.channel == number)
            held = [(r, own & (stack.run == r)) for r in np.unique(stack.run[own])]
            shaped = [(r, *_shaped(stack, mask, residual, colour)) for r, mask in held if mask.sum() >= FEW]
            for (one, before, by_chance), (two, after, too) in pairwise(shaped):
                if np.abs(terms[one] - terms[two]).max() <= EQUAL:
                    found.append(np.array((after - before, np.sqrt(by_chance + too))))
        out[number] = _spread(found)
    return out


def _shaped(stack: Stack, mask: Bools, residual: Array, colour: Colour) -> tuple[Array, Array]:
    """Coefficients (SHAPES,) of what a run did in a cell, and their variance by noise; NaN where it is too short."""
    shapes = _shapes(stack.time[mask])
    inverse = np.linalg.pinv(shapes)
    noise = covariance(colour, stack.time[mask], stack.gaps[mask])
    out = np.full((2, SHAPES), np.nan)
    out[:, : shapes.shape[1]] = inverse @ residual[mask], np.diag(inverse @ noise @ inverse.T)
    return out[0], out[1]


def _shapes(time: Array) -> Array:
    """Legendre polynomials (n, 1 or SHAPES) over a stretch of time."""
    along = 2.0 * (time - time.min()) / max(float(np.ptp(time)), 1e-9) - 1.0
    return np.asarray(legendre.legvander(along, SHAPES - 1 if time.size >= LONG else 0))


def _spread(found: list[Array]) -> Array:
    """Standard deviations (SHAPES,), from differences and what noise alone makes of them (2, SHAPES) each.

    Of means what exceeds the noise; of drifts too, where noise alone makes so much in few cases only.
    """
    out = np.zeros(SHAPES)
    for order, (differences, noise) in enumerate(np.array(found).reshape(-1, 2, SHAPES).transpose(2, 1, 0)):
        known = np.isfinite(differences)
        excess = 0.5 * float(np.mean((differences**2 - noise**2)[known])) if known.sum() >= PAIRS else 0.0
        rare = chi2.sf(float(np.sum((differences / noise)[known] ** 2)), max(int(known.sum()), 1)) < RARE
        if excess > 0.0 and (order == 0 or rare):
            out[order] = np.sqrt(excess)
    return out


def plate_columns(stack: Stack, change: Array, own: Callable[[float], float]) -> Array:
    """What each set of weights may be off by, for itself (N, m), each one standard deviation.

    change: (N,) derivative of the prediction by a common relative error of all weights.
    own:    relative standard deviation of weights [N], for themselves.
    """
    load = stack.covariate("load")
    level = np.rint(np.log(np.maximum(load, 1e-9)) / SAME).astype(int)
    masks = [level == one for one in np.unique(level[load > 0.0])]
    if not 1 < len(masks) <= MANY:
        return np.zeros((stack.size, 0))
    return np.column_stack([np.where(mask, own(float(load[mask].mean())) * change, 0.0) for mask in masks])


def _terms(stack: Stack) -> Array:
    """Pass and start of each run (runs, 2): on other terms a repetition is no replicate."""
    rows = []
    for run in stack.rig.runs:
        passes = run.covariates.get("pass", np.zeros(1))
        rows.append((float(passes[0]), float(run.covariates["position"][0])))
    return np.array(rows)


def run_columns(stack: Stack, spread: Array) -> Array:
    """Offsets of each run and channel, and drifts of each run in each cell (N, m), one standard deviation each.

    spread: (channels, SHAPES), see `between_runs`.
    """
    columns, label = [], cells(stack)
    for number, sigma in enumerate(spread):
        for run in range(len(stack.rig.runs)):
            own = (stack.channel == number) & (stack.run == run) & (stack.covariate("speed") > 0.0)
            if sigma[0] > 0.0:
                columns.append(np.where(own, sigma[0], 0.0))
            if sigma[1:].any():
                columns += [column for cell in np.unique(label[own]) if cell >= 0
                            for column in _drifts(stack, own & (label == cell), sigma)]  # fmt: skip
    return np.column_stack(columns) if columns else np.zeros((stack.size, 0))


def _drifts(stack: Stack, mask: Bools, sigma: Array) -> Iterator[Array]:
    if mask.sum() >= LONG:
        shapes = _shapes(stack.time[mask])
        for order in np.flatnonzero(sigma[1:]) + 1:
            column = np.zeros(stack.size)
            column[mask] = sigma[order] * shapes[:, order]
            yield column
