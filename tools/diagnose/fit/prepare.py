"""From a rig to a problem: the base model fitted, the noise known, the surrogates drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.fit import functions as generic
from gritd.tools.diagnose.fit.evidence import Signature
from gritd.tools.diagnose.fit.problem import Fitted, Problem
from gritd.tools.diagnose.fit.signatures import raw_signatures, ripple_columns
from gritd.tools.diagnose.noise import colour as noise
from gritd.tools.diagnose.noise import lines, replicates
from gritd.tools.diagnose.rig.interface import Rig, Stack
from gritd.tools.diagnose.screen.screen import noise_draws

# of a channel's size: what integration rules and idealised servos may be off by, smoothly
TOLERANCE = 1.5e-3
ROUGH = 3  # rounds of the first fit, whose only use is to linearise


@dataclass(frozen=True)
class Prepared:
    problem: Problem
    base: Fitted
    generics: list[Signature]
    draws: tuple[Array, Array]


def prepare(rig: Rig, rng: np.random.Generator) -> Prepared:
    """Fit with white noise, find the noise's size and colour with everything explained away, fit
    again.
    """
    stack = Stack(rig)
    u = np.zeros(len(rig.constants))
    tolerance = generic.tolerance(stack, TOLERANCE)
    first = noise.first_guess(stack, stack.predict(u))
    rough = Problem(stack, first, tolerance).descend((), (), u, np.zeros(0), ROUGH)
    generics = generic.signatures(stack)
    smooth = [
        n for n, e in rig.effects.items() if not any(p.scan and not p.unit for p in e.parameters())
    ]
    explained = [
        s.columns for s in (*raw_signatures(stack, rough.u, rough.predicted, smooth), *generics)
    ]
    left, likely = stack.measured - rough.predicted, np.column_stack([*explained, rough.raw])
    ripples, cells = ripple_columns(stack, left), replicates.cells(stack)
    standing = lines.standing(stack, left, likely, ripples, cells)
    found = noise.fit(
        stack, rough.predicted, (likely, np.column_stack((ripples, standing))), cells, first, rng
    )
    own = replicates.own_columns(stack, left, found.colours, standing)
    problem = Problem(stack, found, np.column_stack((tolerance, own)))
    base = problem.descend((), (), rough.u, np.zeros(0))
    return Prepared(problem, base, generics, noise_draws(found, base.jacobian.shape[1], rng))
