"""What is left when the accepted names are taken: by channel and condition, in physical units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.wording import shown, spaced, spelled
from gritd.tools.diagnose.explain.result import Discrepancy, Remainder
from gritd.tools.diagnose.explain.wording import along_covariate, signed
from gritd.tools.diagnose.fit.evidence import Signature
from gritd.tools.diagnose.fit.functions import smooth_signatures
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SQUARE

WITHIN = "within the noise"
ALONG = [(name,) for name in ("slip", "load", "speed", "position", "time", "wheel_angle")]


def remainders(problem: Problem, model: Model) -> Mapping[str, Remainder]:
    """Of each channel: what the model predicts without its discrepancies but with the profiles of
    its effects, against the recording, beyond the noise.
    """
    stack, rig, found = problem.stack, problem.stack.rig, {}
    every = smooth_signatures(stack, everywhere=True)
    left = stack.measured - model.fitted.predicted - model.profiles()[0]

    for channel, colour in zip(rig.channels, problem.noise.colours, strict=True):
        squares = float(np.mean(left[stack.of(channel)] ** 2)) - colour.sigma**2
        size = float(np.sqrt(max(squares, 0.0)))
        near = size <= colour.sigma
        functions = [s for s in every if s.shape.channel == channel]
        where = WITHIN if near else _where(stack, channel, functions, left)
        found[channel] = Remainder(size, rig.units[channel], where)

    return found


def _where(stack: Stack, channel: str, functions: Sequence[Signature], left: Array) -> str:
    """Along which condition a channel's remainder (N,) changes most, in words."""
    own = stack.of(channel) & (stack.covariate("speed") > 0.0)
    shares = {name: _share(s.columns[own], left[own]) for s in functions
              for name in s.shape.along if s.shape.along in ALONG}  # fmt: skip
    name = max(shares, key=lambda n: shares[n], default="")
    if shares.get(name, 0.0) >= TUNING.explain.least_share:
        return along_covariate(stack, left, channel, name)
    mean = float(np.mean(left[own])) if own.any() else 0.0
    return f"{signed(mean, stack.rig.units[channel])} on average, uncorrelated with any covariate"


def _share(columns: Array, left: Array) -> float:
    """Share of the squares about the mean that functions (n, m) take."""
    about, columns = left - left.mean(), columns - columns.mean(axis=0)
    fitted = columns @ np.linalg.lstsq(columns, about, rcond=None)[0]
    return 1.0 - float(np.sum((about - fitted) ** 2)) / max(float(about @ about), SQUARE)


def missed_words(channel: str, left: Remainder, where: bool) -> str:
    """A channel and what is missed of it, and where; empty where that is within the noise."""
    if left.where == WITHIN:
        return ""
    unit, factor = shown(left.unit)
    missed = f"{spelled(channel)} by {spaced(left.rms * factor, unit, 2)}"
    return f"{missed} ({left.where})" if where else missed


def discrepancies(problem: Problem, model: Model) -> Mapping[str, Discrepancy]:
    """Of each channel, the standard deviation that the learnt discrepancy of form has there,
    averaged over its sizes.
    """
    stack, rig, marginal = problem.stack, problem.stack.rig, model.marginal
    squares, learnt = np.zeros(stack.size), "prior"

    if marginal is not None and marginal.terms:
        learnt = "reference" if stack.referred else "recordings"
        for number, freedom in enumerate(marginal.terms):
            size = marginal.size_of(model.chosen, number)
            squares += size**2 * np.sum(freedom.columns.dense**2, axis=1)

    found = {}
    for channel in rig.channels:
        own = stack.of(channel)
        size = float(np.sqrt(np.mean(squares[own]))) if own.any() else 0.0
        found[channel] = Discrepancy(size, rig.units[channel], learnt)

    return found
