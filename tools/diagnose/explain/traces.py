"""What a report draws: traces of every channel and run, and residuals over the covariate where the
misfit lives.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.explain.result import Location, Scatter, Trace
from gritd.tools.diagnose.fit.heldout import HeldOut
from gritd.tools.diagnose.fit.problem import Problem
from gritd.tools.diagnose.rig.interface import Bools
from gritd.tools.diagnose.tuning import TUNING


def traces(problem: Problem, before: HeldOut, after: HeldOut) -> tuple[Trace, ...]:
    """Values that the comparison used, predictions with the value's own run held out."""
    stack, rig = problem.stack, problem.stack.rig
    out = []
    for channel, number in stack.parts:
        own = stack.of(channel) & (stack.run == number)
        run = rig.runs[number]
        used = run.used[channel]

        sigma = problem.noise.colours[rig.channels.index(channel)].sigma
        out.append(
            Trace(
                run.name,
                channel,
                rig.units[channel],
                _digits(run.time),
                _digits(run.measured[channel]),
                _spread(before.predicted[own], used),
                _spread(after.predicted[own], used),
                used.astype(int).tolist(),
                sigma,
            )
        )
    return tuple(out)


def _spread(values: Array, used: Bools) -> list[float]:
    """Values at the used places, NaN elsewhere."""
    out = np.full(used.size, np.nan)
    out[used] = values
    return _digits(out)


def _digits(values: Array) -> list[float]:
    """As many digits as a picture shows, and some more: a file of them is half as large."""
    return [float(f"{value:.6g}") for value in values.tolist()]


def scatters(
    problem: Problem, location: Sequence[Location], before: HeldOut, after: HeldOut
) -> tuple[Scatter, ...]:
    stack, rig = problem.stack, problem.stack.rig
    out = []
    for place in location[: TUNING.explain.shown]:
        name = place.covariate
        own = stack.of(place.channel)
        x = stack.run.astype(float) if name == "run" else stack.covariate(name)

        measured = stack.measured[own]
        sigma = problem.noise.colours[rig.channels.index(place.channel)].sigma
        out.append(
            Scatter(
                place.channel,
                place.covariate,
                rig.units[place.channel],
                rig.units.get(name, ""),
                _digits(x[own]),
                _digits(measured - before.predicted[own]),
                _digits(measured - after.predicted[own]),
                stack.run[own].tolist(),
                sigma,
            )
        )
    return tuple(out)
