"""What a reader should doubt: strained constants, parameters at a bound, fits that did not
converge, noise that no sensor makes.
"""

from __future__ import annotations

from collections.abc import Iterator

from gritd.tools.cli.wording import fixed, shown, sigmas, spaced, spelled
from gritd.tools.diagnose.explain.result import SOIL
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.noise.colour import Noise
from gritd.tools.diagnose.rig.interface import Constant, Rig
from gritd.tools.diagnose.tuning import TUNING


def doubts(rig: Rig, model: Model, noise: Noise) -> tuple[str, ...]:
    """One sentence each, of the fit of the accepted model in the noise that was found."""
    return (*_bounded(rig, model), *_unfinished(model), *_loud(rig, noise))


def strains(rig: Rig, model: Model) -> list[tuple[str, float]]:
    """Constants far from what is known of them [σ], in words, the farthest first."""
    constants = zip(rig.constants, model.fitted.u.tolist(), strict=True)
    far = [(_words(c), u) for c, u in constants if abs(u) >= TUNING.explain.doubtful]
    return sorted(far, key=lambda each: -abs(each[1]))


def _words(constant: Constant) -> str:
    """A constant; of a bed that was prepared anew, whose change it is."""
    if constant.changes:
        return f"{SOIL[constant.changes]} of the new bed"
    if constant.channel:
        return f"{constant.kind} of {spelled(constant.channel)}"
    return SOIL.get(constant.name, constant.name)


def strained(rig: Rig, model: Model) -> Iterator[str]:
    """One sentence for each of them."""
    for name, strain in strains(rig, model):
        yield f"Strained: {name} stands {sigmas(strain)} from what is known of it."


def _bounded(rig: Rig, model: Model) -> Iterator[str]:
    fitted = model.fitted
    for constant, held in zip(rig.constants, fitted.held, strict=False):
        if held:
            yield f"At its bound: {_words(constant)}, as far from what is known of it as it may go."
    for number, free in enumerate(fitted.free):
        nothing = free.parameter.role == "strength" and fitted.x[number] == 0.0
        if fitted.held[len(fitted.u) + number] and not nothing:
            value = f"{free.value(float(fitted.x[number])):.3g} {free.parameter.unit}".rstrip()
            yield f"At its bound: {free.parameter.name} of {free.name} is {value}."


def _unfinished(model: Model) -> Iterator[str]:
    if not model.fitted.converged:
        yield "The fit of what is said here did not converge: take its numbers with care."


def _loud(rig: Rig, noise: Noise) -> Iterator[str]:
    """Channels whose grid values scatter more than single readings should; a row of a table is no
    reading.
    """
    if rig.tabled:
        return
    for channel, colour in zip(rig.channels, noise.colours, strict=True):
        stated = rig.stated_noise.get(channel, 0.0)
        if stated > 0.0 and colour.sigma > TUNING.explain.doubtful * stated:
            unit, factor = shown(rig.units[channel])
            found, of_reading = (spaced(s * factor, unit, 2) for s in (colour.sigma, stated))
            yield (
                f"Noise exceeds the stated σ: the noise of {spelled(channel)} is {found},"
                f" {fixed(colour.sigma / stated, 0)} times the stated noise of a reading,"
                f" {of_reading}. What the model misses may be in it."
            )
