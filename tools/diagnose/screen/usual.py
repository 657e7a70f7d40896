"""What the runs of a reference campaign would raise, if each were the new one.

Beside a reference, what is new must be more than a rig that is a little off its model anyway. How
much that is its own runs show: every run of it is judged as if it alone were new, by the effects
and functions that the new campaign is judged by, which itself says nothing of it. What is usual of
the soil says nothing of the drive: each kind is held against its own. Runs that are off
each in its own way do not add up: of n runs whose strengths scatter about nought the common one is
as many σ from it as that of a single run.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit.evidence import Signature, log_bayes, log_evidence, log_sum
from gritd.tools.diagnose.fit.functions import smooth_signatures
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.fit.projection import Projection
from gritd.tools.diagnose.fit.signatures import signature
from gritd.tools.diagnose.noise.colour import whiten
from gritd.tools.diagnose.rig.interface import Bools, Rig
from gritd.tools.diagnose.screen.evidence import Pass
from gritd.tools.diagnose.screen.gram import Gram
from gritd.tools.diagnose.screen.scans import Family, families, without_harmonics
from gritd.tools.diagnose.tuning import TUNING

DRIVE, EFFECTS, UNEXPLAINED = "effects of the drive", "effects", "unexplained"


def kinds_of(rig: Rig) -> dict[str, str]:
    """Of every effect, what kind of explanation it is: of the drive, or any other."""
    return {n: DRIVE if e.stage == "drivetrain" else EFFECTS for n, e in rig.effects.items()}


def usual(problem: Problem, model: Model, first: Pass) -> dict[str, float]:
    """Of every kind of explanation the largest log likelihood ratio of a run of the reference
    [nats, 0 at least].

    first: of the effects in the new campaign, whose likeliest shapes are tried.
    """
    stack, kinds = problem.stack, kinds_of(problem.stack.rig)
    runs = [stack.run == number for number in np.flatnonzero(~np.array(stack.rig.new))]
    every = {UNEXPLAINED: [_of_functions(problem, model, runs)]}
    for name, own in _of_effects(problem, model, first, runs):
        every.setdefault(kinds[name], []).append(own)
    means = {kind: log_sum(each) - np.log(len(each)) for kind, each in every.items()}
    return {kind: float(np.max(mean, initial=0.0)) for kind, mean in means.items()}


def unnamed_in_both(
    problem: Problem, model: Model, functions: Sequence[Signature], searched: Sequence[Family]
) -> float:
    """Log mean Bayes factor of what has no name, is shown by the reference alone and acts in both
    campaigns, in each of an amplitude of its own [nats]: it is no news. None shown: minus infinity.

    functions: in the new campaign; searched: waves and steps there.
    """
    new, shapes = problem.stack.new, {s.shape for s in functions}
    every = [s for s in smooth_signatures(problem.stack, everywhere=True) if s.shape in shapes]
    least = -float(np.log(TUNING.screen.level))

    projection = model.fitted.projection()
    known = _gains(problem, projection.of_rows(~new), every, (~new,))
    smooth = [s for s, gain in zip(every, known, strict=True) if gain > least]

    beside = without_harmonics(problem, model.fitted)
    alone = beside.of_rows(~new)
    before = families(problem.stack, problem.noise, ~new)
    shown = {f.shape: f.blocks for f in before if f.average(alone) > least}
    scanned = [
        replace(f, blocks=(*f.blocks, *shown[f.shape])) for f in searched if f.shape in shown
    ]

    gains = [*_gains(problem, projection, smooth, (new, ~new))] if smooth else []
    gains += [family.average(beside) for family in scanned]
    return _mean(gains) if gains else -np.inf


def _of_effects(
    problem: Problem, model: Model, first: Pass, runs: Sequence[Bools]
) -> Iterator[tuple[str, Array]]:
    """Log mean Bayes factor (r,) of every effect in each run."""
    stack, fitted = problem.stack, model.fitted
    gram = Gram(problem, model, ~stack.new)
    for name, every in first.effects.items():
        shapes = [one.signature.fixed for one in every[: TUNING.search.again]]
        effect = stack.rig.effects[name]
        tried = [
            signature(stack, fitted.u, fitted.predicted, effect, fixed, everywhere=True)
            for fixed in shapes
        ]
        made = [_in_runs(problem, gram, one, runs) for one in tried if one is not None]
        if made:
            yield name, np.asarray(log_sum(made) - np.log(len(made)))


def _in_runs(problem: Problem, gram: Gram, made: Signature, runs: Sequence[Bools]) -> Array:
    """Log Bayes factor (r,) of an effect that acts in one run alone."""
    width = len(made.sign)
    columns = np.column_stack([np.where(own[:, None], made.columns, 0.0) for own in runs])
    a, b = gram.project(whiten(problem.noise, columns))
    spans = [slice(width * k, width * (k + 1)) for k in range(len(runs))]
    total = [log_sum(gram.evidence + log_evidence(a[:, o, o], b[:, o], made.sign)) for o in spans]
    return np.array(total) - gram.total


def _of_functions(problem: Problem, model: Model, runs: Sequence[Bools]) -> Array:
    """Log mean Bayes factor (r,) of smooth functions in each run."""
    functions = smooth_signatures(problem.stack, everywhere=True)
    alone = model.fitted.projection().of_rows(~problem.stack.new)
    return np.array([_mean(_gains(problem, alone, functions, (own,))) for own in runs])


def _gains(
    problem: Problem, beside: Projection, functions: Sequence[Signature], parts: Sequence[Bools]
) -> Iterator[float]:
    """Log Bayes factor of each function, with coefficients of its own in each part (N,)."""
    columns = [np.where(own[:, None], s.columns, 0.0) for s in functions for own in parts]
    a, b = beside.project(whiten(problem.noise, np.column_stack(columns)))
    first = 0
    for one in functions:
        sign = one.sign * len(parts)
        part = slice(first, first + len(sign))
        first = part.stop
        yield float(log_bayes(a[part, part], b[part], sign))


def _mean(values: Iterable[float]) -> float:
    every = list(values)
    return float(log_sum(every) - np.log(len(every))) if every else 0.0
