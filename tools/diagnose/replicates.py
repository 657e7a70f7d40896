"""Conditions that were held, and held again: what varies inside a condition is noise, whatever the model.

A cell is a set of values at nearly the same covariates. Means of cells belong to the saturated model, so that a misfit
of any shape over the conditions does not count as noise. Runs that share a cell on equal terms (same pass, same start)
are replicates: what their means differ by, beyond the noise inside a run, is pure error between runs.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from estimator.terramechanics.soil import Array
from tools.diagnose.noise import Colour
from tools.diagnose.rig import Index, Stack

WIDTHS = {"slip": 0.04, "speed": 0.08, "load": 0.05}  # of a cell; of speed and load relative to their largest
FEW, MANY = 10, 60  # values a cell must hold; cells a channel may have
EQUAL = 1e-3  # difference of pass or start at which two runs are no replicates
PAIRS = 2  # comparisons of replicates at least


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
        keys.append(np.rint(values / width).astype(int))
    table = np.column_stack(keys)
    conditions, label = np.unique(table[:, 1:], axis=0, return_inverse=True)
    label = label.ravel()
    count = np.bincount(label) / max(len(stack.rig.channels), 1)
    kept = (count >= FEW) & (conditions[:, 0] > 0)
    renamed = np.where(kept, np.cumsum(kept) - 1, -1)
    return np.asarray(renamed[label], dtype=np.intp)


def between_runs(stack: Stack, residual: Array, colours: tuple[Colour, ...]) -> Array:
    """Standard deviation between replicates beyond the noise inside a run, per channel; 0 where nothing was repeated.

    From successive differences (von Neumann 1941), so that a drift from run to run does not count.
    """
    label, terms = cells(stack), _terms(stack)
    out = np.zeros(len(stack.rig.channels))
    for number, colour in enumerate(colours):
        squares = []
        for cell in range(int(label.max(initial=-1)) + 1):
            own = (label == cell) & (stack.channel == number)
            means = [(r, residual[own & (stack.run == r)]) for r in np.unique(stack.run[own])]
            means = [(r, values) for r, values in means if values.size >= FEW]
            for (one, before), (two, after) in pairwise(means):
                if np.abs(terms[one] - terms[two]).max() <= EQUAL:
                    chance = _variance_of_mean(colour, before.size, stack) + _variance_of_mean(
                        colour, after.size, stack
                    )
                    squares.append(0.5 * ((after.mean() - before.mean()) ** 2 - chance))
        if len(squares) >= PAIRS:
            out[number] = np.sqrt(max(float(np.mean(squares)), 0.0))
    return out


def _terms(stack: Stack) -> Array:
    """Pass and start of each run (runs, 2): on other terms a repetition is no replicate."""
    rows = []
    for run in stack.rig.runs:
        passes = run.covariates.get("pass", np.zeros(1))
        rows.append((float(passes[0]), float(run.covariates["position"][0])))
    return np.array(rows)


def _variance_of_mean(colour: Colour, count: int, stack: Stack) -> float:
    inside = stack.gaps[np.isfinite(stack.gaps)]
    step = float(np.median(inside)) if inside.size else 1.0
    length = count * step
    slow = colour.slow * min(2.0 * colour.time / length, 1.0)
    return colour.sigma**2 * ((1.0 - colour.slow) / count + slow)


def run_columns(stack: Stack, spread: Array) -> Array:
    """Offsets of each run and channel (N, m), each one standard deviation between replicates."""
    columns = []
    for number, sigma in enumerate(spread.tolist()):
        if sigma > 0.0:
            for run in range(len(stack.rig.runs)):
                own = (stack.channel == number) & (stack.run == run) & (stack.covariate("speed") > 0.0)
                columns.append(np.where(own, sigma, 0.0))
    return np.column_stack(columns) if columns else np.zeros((stack.size, 0))
