"""Whether the soil changed: the record explained by one soil, against a change at some instant.

Every stretch of the memory is an affine measurement (line.py) of the soil x and of the calibration
errors b. Both are the same for all stretches as long as the soil stays what it is. A wrong
calibration moves all stretches together, as G says; a change of the soil moves only those after it.
With x and b Gaussian (the posterior of what came before) and a change δ drawn from the prior of the
soil, the Bayes factor of "changed before stretch j" against "never changed" has a closed form. Here
b is estimated: it serves to judge the soil, and does not enter the estimate that is published.

Where nothing changes, a Bayes factor exceeds A in at most 1 of A trials (Ville's inequality), and
the mean time to a false alarm, when a trial begins at every stretch, is at least A stretches
(Pollak 1987, Ann. Statist. 15, 749-779, on the procedure of Shiryaev and Roberts).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gritd.estimator.filter.estimate import STATES, Estimate, Vector
from gritd.estimator.filter.line import Line
from gritd.estimator.filter.tuning import CHANGE
from gritd.estimator.terramechanics.soil import Array

TINY = 1e-9  # of the prior variances, so that a covariance without full rank has a root


class Judgement(NamedTuple):
    """What the record says of s stretches."""

    evidence: Array  # (s,) ln of the Bayes factor of a change before each; the first is not asked
    change: int  # number of the stretch before which the soil changed; 0 where it did not
    x: Vector  # (3,) the state that fits best if nothing changed


def judge(
    before: Estimate,
    variances: Vector,
    spread: Vector,
    lines: Sequence[Line],
    windows: Sequence[int],
) -> Judgement:
    """One soil against a change of it.

    before: what is known of the soil, and its correlation with the nuisances, ahead of the first
    line; variances (q,): of the nuisances; spread (3,): σ of a change of the state; lines (s) and
    how many windows each is the mean of.
    """
    H, G, y = _whitened(lines, windows)
    root = _root(before, variances)
    y = y - H @ np.array(before.x)
    F = np.concatenate((H, G), axis=2) @ root  # (s, 2, d): of normals that are the prior
    steps = H * np.array(spread)  # (s, 2, 3): of the change's normals

    # one soil for all: normal equations of the d normals
    gram = np.eye(len(root)) + _product(F, F).sum(axis=0)
    inverse = np.linalg.inv(gram)
    best = inverse @ np.einsum("smi,sm->i", F, y)

    # and a change on top of it, from each stretch on
    shared = _since(_product(F, steps))
    information = _since(_product(steps, steps)) - shared.transpose(0, 2, 1) @ inverse @ shared
    score = _since(np.einsum("smi,sm->si", steps, y - F @ best))
    x = np.array(before.x) + (root @ best)[:STATES]
    evidence = _evidence(information, score)
    return Judgement(evidence, _change(evidence), tuple(x.tolist()))


def _change(evidence: Array) -> int:
    """The most probable change, if there is evidence enough for one."""
    if len(evidence) < 2:
        return 0
    best = 1 + int(np.argmax(evidence[1:]))
    return best if evidence[best] > CHANGE.alarm else 0


def _evidence(information: Array, score: Array) -> Array:
    """ln of the Bayes factors (s,) of changes with unit normal prior; (s, 3, 3) and (s, 3)."""
    sizes, axes = np.linalg.eigh(information)
    # rounding can leave a size below zero where the change would say nothing
    sizes = np.maximum(sizes, 0.0)
    along = np.einsum("sij,si->sj", axes, score)
    evidence: Array = 0.5 * (along**2 / (1.0 + sizes) - np.log1p(sizes)).sum(axis=1)
    return evidence


def _product(one: Array, other: Array) -> Array:
    """For each stretch the product (s, i, j) over its components."""
    return np.asarray(one.transpose(0, 2, 1) @ other)


def _since(values: Array) -> Array:
    """Sums from each stretch to the last."""
    return np.asarray(np.cumsum(values[::-1], axis=0)[::-1])


def _whitened(lines: Sequence[Line], windows: Sequence[int]) -> tuple[Array, Array, Array]:
    """H (s, 2, 3), G (s, 2, q) and y (s, 2) of unit noise; zeros for a component not measured."""
    y, H, G, R, D = (np.array(column) for column in zip(*map(_full, lines), strict=True))
    noise = R / np.array(windows, float)[:, None, None] + D
    columns = np.concatenate((H, G, y[:, :, None]), axis=2)
    white = np.linalg.solve(np.linalg.cholesky(noise), columns)
    return white[:, :, :STATES], white[:, :, STATES:-1], white[:, :, -1]


def _full(line: Line) -> Line:
    """With a second component that says nothing, where only the torque is measured."""
    if len(line.y) == 2:
        return line

    (h,), (g,), ((r,),), ((d,),) = line.H, line.G, line.R, line.D
    nothing, none = (0.0,) * len(h), (0.0,) * len(g)
    return Line((*line.y, 0.0), (h, nothing), (g, none), ((r, 0.0), (0.0, r)), ((d, 0.0), (0.0, d)))


def _root(before: Estimate, variances: Vector) -> Array:
    """A root (d, d) of the covariance of state and nuisances, d = 3 + q."""
    P, cross = np.array(before.P), np.array(before.cross).reshape(STATES, -1)
    joint = np.block([[P, cross], [cross.T, np.diag(variances)]])
    sigma = np.sqrt(np.diag(joint))
    unit = joint / np.outer(sigma, sigma) if np.all(sigma > 0.0) else _unit(joint, sigma)
    return np.asarray(sigma[:, None] * np.linalg.cholesky(unit + TINY * np.eye(len(joint))))


def _unit(joint: Array, sigma: Array) -> Array:
    """Correlations where some σ are 0."""
    scale = np.where(sigma > 0.0, sigma, 1.0)
    return np.asarray(joint / np.outer(scale, scale))
