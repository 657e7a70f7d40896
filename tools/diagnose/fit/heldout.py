"""Prediction of what was held out: whole runs, and whole conditions (a load, a slip band), by a fit
to the rest.

Around its optimum a model is linear in its unknowns, so a fit without some values is linear algebra
on the Jacobian at hand: no further evaluation of the physics. Repeats of one manoeuvre in the same
fold cannot leak.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.columns import Columns
from gritd.tools.diagnose.fit.problem import Fitted, Problem
from gritd.tools.diagnose.rig.interface import Bools, Index
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN


@dataclass(frozen=True)
class HeldOut:
    """log_density: of each fold given the others [nats]; predicted: (N,) with the value's own fold
    held out.
    """

    log_density: Array
    predicted: Array


def run_folds(stack: Stack) -> list[Bools]:
    """Marks (N,) of each run; of campaigns of few runs, of equal parts of each run in time: what is
    new is learnt from the new runs that are left.
    """
    few = {
        new
        for new in (False, True)
        if np.unique(stack.run[stack.new == new]).size < TUNING.fit.folds
    }
    runs = [stack.run == r for r in np.unique(stack.run) if stack.rig.new[r] not in few]
    ranks = _parts(stack.time, stack.run)
    parted = np.isin(stack.new, list(few))
    parts = [parted & (ranks == k) for k in range(TUNING.fit.folds)]
    return [fold for fold in (*runs, *parts) if fold.any()]


def condition_folds(stack: Stack) -> list[Bools]:
    """Marks (N,) of bands of load and of slip, as far as they vary."""
    folds = []
    for name in ("load", "slip"):
        if name in stack.rig.runs[0].covariates:
            values = stack.covariate(name)
            if np.ptp(values) > TUNING.fit.band_spread * max(float(np.abs(values).max()), SPAN):
                band = _bands(values)
                folds += [band == k for k in range(TUNING.fit.bands)]
    return [f for f in folds if f.any() and not f.all()]


def _bands(values: Array) -> Index:
    edges = np.quantile(values, np.arange(1, TUNING.fit.bands) / TUNING.fit.bands)
    return np.asarray(np.searchsorted(edges, values, side="right"), dtype=np.intp)


def _parts(time: Array, run: Index) -> Index:
    count = TUNING.fit.folds
    out = np.zeros(time.size, dtype=np.intp)
    for r in np.unique(run):
        own = run == r
        span = max(float(np.ptp(time[own])), SPAN)
        part = (count * (time[own] - time[own].min()) / span).astype(int)
        out[own] = np.minimum(part, count - 1)
    return out


def held_out(fitted: Fitted, folds: Sequence[Bools]) -> HeldOut:
    """Density and prediction of every fold, marked (N,), by the model fitted to the others; the
    discrepancies that it learnt are predicted too.
    """
    own = fitted.nuisance.carried
    j, r = fitted.jacobian, fitted.residual
    last = j.count - own.count
    size = len(fitted.u) + len(fitted.x)
    centre = np.concatenate(
        (fitted.u, fitted.x, np.zeros_like(fitted.slack))
    )  # r is the residual without tolerance

    penalty = fitted.penalty**2
    gram, score = fitted.gram + np.diag(penalty), j.pulled(r) - penalty * centre
    joint = cholesky(gram, lower=True, check_finite=False)
    density, predicted = [], fitted.predicted.copy()

    for fold in folds:
        inside, left = j.among(fold), r[fold]
        others = gram - inside.gram
        less = cholesky(others, lower=True, overwrite_a=True, check_finite=False)
        step = cho_solve((less, True), score - inside.pulled(left), check_finite=False)
        predicted[fold] += fitted.raw[fold] @ step[:size] + own.among(fold).times(step[last:])
        density.append(_log_density(left - inside.times(step), inside, joint, less))
    return HeldOut(np.array(density), predicted)


def _log_density(error: Array, jacobian: Columns, joint: Array, others: Array) -> float:
    """ln N(error; 0, I + J A⁻¹ Jᵀ) without the constant, by the matrix inversion lemma.

    joint, others: Cholesky roots (q, q) of A + JᵀJ, and of the products A of the other values.
    """
    pulled = solve_triangular(joint, jacobian.pulled(error), lower=True, check_finite=False)
    spread = np.log(np.diag(joint)).sum() - np.log(np.diag(others)).sum()
    return float(-0.5 * (error @ error - pulled @ pulled) - spread)


def missed(problem: Problem, fitted: Fitted) -> float:
    """What a fit misses of runs that were held out, by their noise: the root of the sum of the mean
    squares of all channels.
    """
    stack = problem.stack
    far = rmse(stack, held_out(fitted, run_folds(stack)).predicted)
    pairs = zip(stack.rig.channels, problem.noise.colours, strict=True)
    return float(np.sqrt(sum((far[channel] / colour.sigma) ** 2 for channel, colour in pairs)))


def rmse(stack: Stack, predicted: Array) -> dict[str, float]:
    """Root mean square error of a prediction (N,), of each channel in its unit."""
    error = stack.measured - predicted
    return {c: float(np.sqrt(np.mean(error[stack.of(c)] ** 2))) for c in stack.rig.channels}
