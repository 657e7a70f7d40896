"""Where the misfit lives: channel by covariate, with its share, its chance, where it starts or
stops, and a sentence.

In each channel functions are taken up by evidence, one beside the others, so that one place of the
misfit is not reported once for every covariate that varies along with it: smooth functions, waves,
ripples of the wheel, steps, and stretches between two steps. Each stands about a mean of its own:
what grows with slip from nothing is not shown as a constant and a slope. What drifts or curves is
taken by a smooth function and has no change point.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from gritd.estimator.terramechanics.soil import Array
from gritd.tools.diagnose.explain import wording
from gritd.tools.diagnose.explain.result import Location
from gritd.tools.diagnose.fit import heldout
from gritd.tools.diagnose.fit.evidence import Signature
from gritd.tools.diagnose.fit.model import Model
from gritd.tools.diagnose.fit.selection import Parts, Taken, Tried, likeliest, parts_of, take_up
from gritd.tools.diagnose.fit.shape import Shape
from gritd.tools.diagnose.rig.stack import Stack
from gritd.tools.diagnose.screen.scans import (
    candidates,
    more_families,
    windows,
    without_harmonics,
)
from gritd.tools.diagnose.screen.screening import Screening
from gritd.tools.diagnose.tuning import TUNING
from gritd.tools.diagnose.tuning.guards import SPAN

PREPARED = (("run",), ("position",))  # along which soil is made, not driven
STRAINED = ("scale", "offset")  # constants of a channel's calibration
Place = tuple[float, Location]  # with the nats that it takes


@dataclass(frozen=True, eq=False)
class Dictionary:
    """Functions of all channels beside a model. kinds: number of families of each channel among
    which they are.
    """

    functions: Sequence[Signature]
    parts: Parts
    kinds: Mapping[str, int]

    def of(self, channel: str) -> list[int]:
        """Those of a channel."""
        return [k for k, f in enumerate(self.functions) if f.shape.channel == channel]

    def choose(self, tried: Tried, slack: float) -> int:
        """The likeliest function; in its place a mean, or steps between runs or along the bed, that
        are nearly as likely; or one in time or slip that is far likelier than a smooth function: a
        motion that is driven in steps has them, so these do not compete with other covariates.
        """
        shapes = {k: self.functions[k].shape for k in tried}
        free = {k: e for k, e in tried.items() if not _scheduled(shapes[k])}
        best = likeliest(free or tried)
        along = shapes[best].along

        plain = [("constant",), *([along] if along in PREPARED else [])]
        alike = [k for k in tried if shapes[k].along in plain and tried[k] >= tried[best] - slack]
        if alike:
            return min(alike, key=lambda k: (self.parts.own[k].size, -tried[k]))
        steps = [k for k in tried if shapes[k].places and shapes[k].along == along]
        return likeliest({best: tried[best] + slack, **{k: tried[k] for k in steps}})


def _scheduled(shape: Shape) -> bool:
    return bool(shape.places) and shape.along[0] in ("time", "slip")


def unmoved(screening: Screening, accepted: Model) -> Model:
    """The base model held at the constants found beside the accepted effects: what it misses is
    what they do.

    Fitted for itself, the base model moves soil and calibration until they hide what they can of
    the misfit, and what is left shows where they cannot follow, not where the misfit was made. With
    a reference campaign, what both campaigns do is none of it.
    """
    fit, nuisance = accepted.fitted, screening.problem.nuisance
    alone = screening.problem.descend((), (), fit.u, np.zeros(0), rounds=0)
    own, whitened = accepted.discrepancy()
    if screening.problem.stack.referred:
        alone = replace(alone, predicted=alone.predicted + own, residual=alone.residual - whitened)

    held = replace(
        alone,
        u=np.zeros_like(fit.u),
        own=np.zeros_like(alone.own),
        pulled=np.zeros_like(alone.pulled),
        nuisance=alone.nuisance.without_size(),
        residual=alone.residual - nuisance.whitened.times(fit.slack[: nuisance.count]),
    )
    return Model(held)


def locate(
    screening: Screening, model: Model, predicted: Array | None = None
) -> tuple[Location, ...]:
    """Places of the misfit of a model, by evidence; only those that noise shows in a channel in
    one campaign of a hundred at most, all that were tried there counted.

    predicted: (N,) against which the sentences are said; without it the model's, each value's own
        run held out.
    """
    stack = screening.problem.stack
    if predicted is None:
        predicted = heldout.held_out(model.fitted, heldout.run_folds(stack)).predicted
    residual = stack.measured - predicted

    tried = dictionary(screening, model)
    places = _strains(stack, model)
    for channel in stack.rig.channels:
        places += _places(stack, residual, tried, channel)
    named: dict[tuple[str, str], Location] = {}
    for _, place in sorted(places, key=lambda each: -each[0]):
        named.setdefault((place.channel, place.covariate), place)  # of several the first
    return tuple(named.values())


def dictionary(screening: Screening, model: Model) -> Dictionary:
    """All smooth functions; the likeliest wave of each channel and axis, its likeliest steps and
    the likeliest stretch between two.
    """
    problem = screening.problem
    beside = without_harmonics(problem, model.fitted)
    families = [*screening.families, *more_families(problem.stack, problem.noise)]
    rows = [("run",)] if problem.stack.rig.tabled else []  # each is known by its slip and load
    smooth = [s for s in screening.functions if s.shape.along not in (("wheel_angle",), *rows)]

    likeliest: dict[Shape, Signature] = {}
    for one in candidates(families, problem, beside):
        wave = one.shape.kind == "wave"
        likeliest.setdefault(one.shape.family if wave else one.shape, one)
    functions = [*smooth, *likeliest.values(), *windows(families, problem, beside)]

    parts = parts_of(beside, problem.noise, functions)
    means = {
        f.shape.channel: own
        for f, own in zip(functions, parts.own, strict=True)
        if f.shape.along == ("constant",)
    }
    about = [
        np.union1d(own, means.get(f.shape.channel, own))
        for f, own in zip(functions, parts.own, strict=True)
    ]
    steps = [f.shape for f in families if f.shape.kind == "step"]  # and stretches between two
    tried = [*(s.shape for s in smooth), *(f.shape for f in families), *steps]
    kinds = Counter(shape.channel for shape in tried)
    return Dictionary(functions, replace(parts, own=about), kinds)


def _places(stack: Stack, residual: Array, tried: Dictionary, channel: str) -> list[Place]:
    """Of one channel, a place for every covariate that is taken up."""
    here = tried.of(channel)
    if not here:
        return []
    kinds = tried.kinds[channel]
    least = float(np.log(kinds / TUNING.screen.level))
    taken = take_up(tried.parts, here, len(here), least, TUNING.explain.least_share, tried.choose)
    whole = max(tried.parts.gain(here), SPAN)

    groups: dict[str, list[int]] = {}
    for number, k in enumerate(taken.parts):
        groups.setdefault(_covariate(tried, tried.functions[k].shape, here), []).append(number)
    places = []
    for covariate, group in groups.items():
        nats = sum(_added(tried, taken, n) for n in group)
        p = float(np.exp(-taken.gains[group[0]]))
        share = float(np.clip(nats / whole, 0.0, 1.0))
        if share >= TUNING.explain.least_share:
            shapes = [tried.functions[taken.parts[n]].shape for n in group]
            size = _size(tried, taken, group[0])
            words = wording.sentence(stack, residual, shapes[0], covariate, share, size)
            location = Location(
                channel, covariate, share, p, min(p * kinds, 1.0), words,
                tuple(_changes(covariate, shapes)),
            )  # fmt: skip
            places.append((nats, location))
    return places


def _added(tried: Dictionary, taken: Taken, number: int) -> float:
    """Nats that a function gains beside those before it."""
    before, beside = taken.parts[:number], taken.parts[: number + 1]
    return tried.parts.gain(beside) - tried.parts.gain(before)


def _covariate(tried: Dictionary, shape: Shape, here: list[int]) -> str:
    """A product of covariates is filed under the one that takes most alone."""
    smooth = {tried.functions[k].shape: [k] for k in here}
    alone = {n: tried.parts.gain(smooth.get(Shape(shape.channel, (n,)), [])) for n in shape.along}
    return max(alone, key=lambda name: alone[name])


def _changes(covariate: str, shapes: Sequence[Shape]) -> Iterator[float]:
    """Where the misfit starts or stops, if it does not first of all curve; of runs, the number of
    the first beyond.
    """
    places = {at for shape in shapes for at in shape.places} if shapes[0].places else set()
    yield from sorted(float(np.ceil(at)) if covariate == "run" else at for at in places)


def _size(tried: Dictionary, taken: Taken, number: int) -> float:
    """Amplitude of a wave beside all that was taken up, in the channel's unit."""
    k = taken.parts[number]
    own, columns = tried.parts.own[k], tried.functions[k].columns
    a, b = tried.parts.a[np.ix_(own, own)], tried.parts.b[own]
    weights = np.linalg.solve(a + np.eye(own.size), b)  # the mean's come first
    added = columns @ weights[own.size - columns.shape[1] :]
    acting = added[added != 0.0]
    return float(np.sqrt(2.0 * np.mean(acting**2))) if acting.size else 0.0


def _strains(stack: Stack, model: Model) -> list[Place]:
    """Calibration constants pulled far off what is known: a misfit that hides there leaves no
    residual.
    """
    nats = 0.5 * model.fitted.u**2
    places = []

    constants = zip(stack.rig.constants, model.fitted.u.tolist(), nats.tolist(), strict=True)
    for constant, u, taken in constants:
        channel, kind = constant.channel, constant.kind
        if kind in STRAINED and abs(u) > TUNING.explain.doubtful:
            words = wording.strain(channel, kind, constant.of(u), constant.unit, u)
            p, share = float(2.0 * ndtr(-abs(u))), taken / float(nats.sum())
            places.append((taken, Location(channel, "constant", share, p, p, words)))
    return places
