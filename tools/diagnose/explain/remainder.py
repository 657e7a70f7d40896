"""What is left when the accepted names are taken: by channel and condition, in physical units."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.cli.wording import shown, spaced, spelled
from gritd.tools.diagnose.explain.result import Discrepancy, Remainder
from gritd.tools.diagnose.explain.wording import signed, value_of
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN

WITHIN = "within the noise"
ALONG = ("slip", "load", "speed", "position", "time", "wheel_angle")


def remainders(problem: Problem, model: Model) -> Mapping[str, Remainder]:
    """Of each channel: what the model predicts without its discrepancies, against the recording,
    beyond the noise.
    """
    stack, rig = problem.stack, problem.stack.rig
    left = stack.measured - model.fitted.predicted
    told = {}

    for channel, colour in zip(rig.channels, problem.noise.colours, strict=True):
        own = np.flatnonzero(stack.of(channel))
        squares = float(np.mean(left[own] ** 2)) - colour.sigma**2
        size = float(np.sqrt(max(squares, 0.0)))
        where = (
            _where(stack, channel, left)
            if size > TUNING.explain.remainder_noise * colour.sigma
            else WITHIN
        )
        told[channel] = Remainder(size, rig.units[channel], where)

    return told


def _where(stack: Stack, channel: str, left: Array) -> str:
    """Along which condition a channel's remainder (N,) changes most, in words."""
    own = stack.of(channel) & (stack.covariate("speed") > 0.0)
    unit = stack.rig.units[channel]
    mean = float(np.mean(left[own])) if own.any() else 0.0

    known = [name for name in ALONG if name in stack.rig.runs[0].covariates]
    shares = {name: _share(stack.covariate(name)[own], left[own]) for name in known}
    name = max(shares, key=lambda n: shares[n])
    if shares[name] < TUNING.explain.remainder_share:
        return f"{signed(mean, unit)} on average, uncorrelated with any covariate"

    along = stack.covariate(name)[own]
    edges = np.quantile(along, np.linspace(0.0, 1.0, TUNING.explain.remainder_parts + 1))
    low, high = along <= edges[1], along >= edges[-2]
    ends = [
        f"{signed(float(np.mean(left[own][part])), unit)} at "
        f"{value_of(stack, name, float(along[part].mean()))}"
        for part in (low, high)
    ]
    return ", ".join(ends)


def _share(along: Array, left: Array) -> float:
    """Share of the squares about the mean that a smooth function of a covariate takes."""
    if along.size < TUNING.explain.remainder_values or np.ptp(along) <= SPAN:
        return 0.0
    scaled = (along - along.mean()) / np.ptp(along)
    columns = np.vander(scaled, TUNING.explain.remainder_bends + 1)
    fitted = columns @ np.linalg.lstsq(columns, left, rcond=None)[0]
    spread = float(np.sum((left - left.mean()) ** 2))
    return 1.0 - float(np.sum((left - fitted) ** 2)) / spread if spread > 0.0 else 0.0


def missed_words(channel: str, left: Remainder) -> str:
    """A channel and what is missed of it; empty where that is within the noise."""
    if left.where == WITHIN:
        return ""
    unit, factor = shown(left.unit)
    return f"{spelled(channel)} by {spaced(left.rms * factor, unit, 2)} ({left.where})"


def discrepancies(problem: Problem, model: Model) -> Mapping[str, Discrepancy]:
    """Of each channel, the standard deviation that the learnt discrepancy of form has there,
    averaged over its sizes.
    """
    stack, rig, marginal = problem.stack, problem.stack.rig, model.marginal
    squares, learnt = np.zeros(stack.size), "prior"

    if marginal is not None and marginal.freedoms:
        learnt = "reference" if stack.referred else "recordings"
        for number, freedom in enumerate(marginal.freedoms):
            size = marginal.size_of(model.chosen, number)
            squares += size**2 * np.sum(freedom.columns**2, axis=1)

    told = {}
    for channel in rig.channels:
        own = stack.of(channel)
        size = float(np.sqrt(np.mean(squares[own]))) if own.any() else 0.0
        told[channel] = Discrepancy(size, rig.units[channel], learnt)

    return told
