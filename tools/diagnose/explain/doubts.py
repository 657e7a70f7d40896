"""What a reader should doubt: strained constants, parameters at a bound, fits that did not
converge.
"""

from __future__ import annotations

from collections.abc import Iterator

from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.rig.interface import Rig
from gritd.tools.diagnose.tuning import TUNING


def doubts(rig: Rig, model: Model) -> tuple[str, ...]:
    """One sentence each, of the fit of the accepted model."""
    return (*_strained(rig, model), *_bounded(rig, model), *_unfinished(model))


def strains(rig: Rig, model: Model) -> list[tuple[str, float]]:
    """Constants far from what is known of them [σ], the farthest first."""
    told = [(c.name, float(u)) for c, u in zip(rig.constants, model.fitted.u, strict=True)]
    far = [(name, u) for name, u in told if abs(u) >= TUNING.explain.doubtful_constant]
    return sorted(far, key=lambda each: -abs(each[1]))


def _strained(rig: Rig, model: Model) -> Iterator[str]:
    for name, strain in strains(rig, model):
        yield f"Strained: {name} stands {strain:+.1f} σ from what is known of it."


def _bounded(rig: Rig, model: Model) -> Iterator[str]:
    fitted = model.fitted
    for constant, held in zip(rig.constants, fitted.held, strict=False):
        if held:
            yield f"At its bound: {constant.name}, as far from what is known of it as it may go."
    for number, free in enumerate(fitted.free):
        nothing = free.parameter.role == "strength" and fitted.x[number] == 0.0
        if fitted.held[len(fitted.u) + number] and not nothing:
            value = f"{free.value(float(fitted.x[number])):.3g} {free.parameter.unit}".rstrip()
            yield f"At its bound: {free.parameter.name} of {free.name} is {value}."


def _unfinished(model: Model) -> Iterator[str]:
    if not model.fitted.converged:
        yield "The fit of what is said here did not converge: take its numbers with care."
